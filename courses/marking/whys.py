"""Why a part has its points: sentences by code, translated by :mod:`courses.assignments.wording`."""

from paddock.errors.reasons import gettext_noop as _

WHYS = {
    "passed": _("Passed on every track."),
    "by_time": _("Points by time: %(value)s."),
    "place": _("Place %(value)s."),
    "too_few_laps": _("%(value)s of %(laps)s complete laps in a row."),
    "too_slow": _("%(value)s, at most %(at_most_ms)s needed."),
    "no_lap": _("Too few complete laps for a time."),
    "not_driven": _("Nothing was driven."),
    "waits": _("A run is not over yet."),
    "hidden_waits": _("Hidden tracks are drawn at the deadline."),
    "place_waits": _("Places are known when all runs are over."),
}
