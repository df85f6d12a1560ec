"""The figures of a live event in words, for its page and its paper."""

from __future__ import annotations

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from core.times import clock

from .statistics import EventFigures


def figure_words(figures: EventFigures) -> list[tuple[str, str]]:
    """(name, value) of each figure that there is, in the present language."""
    runs = ngettext("%(count)s run", "%(count)s runs", figures.runs) % {"count": figures.runs}
    if figures.without_result:
        runs += ", " + _("%(count)s without a result") % {"count": figures.without_result}
    said = [
        (_("Driven"), runs),
        (_("Complete laps"), f"{figures.laps} ({figures.distance_m / 1000:.2f} km)"),
    ]
    if figures.fastest is not None:
        of = figures.fastest
        said.append((_("Fastest lap"), f"{clock(of.time_ms)} · {of.racer} · " + _("lap %(lap)s") % {"lap": of.lap}))
    if figures.best_sectors:
        said.append((_("Best sectors"), " · ".join(f"{each / 1000:.3f}" for each in figures.best_sectors)))
    if figures.average_mps is not None:
        said.append((_("Average speed"), f"{figures.average_mps:.2f} m/s"))
    said.append((_("Off tracks"), str(figures.off_tracks)))
    said.append((_("Crashes"), str(figures.crashes)))
    said.append((_("Resets"), str(figures.resets)))
    if figures.lead_changes is not None:
        said.append((_("Changes of the lead"), str(figures.lead_changes)))
    if figures.gain is not None:
        of_gain = figures.gain
        moved = _("%(racer)s, from place %(before)s to %(after)s")
        said.append(
            (
                _("Biggest gain"),
                moved % {"racer": of_gain.racer, "before": of_gain.before, "after": of_gain.after},
            )
        )
    if figures.closest_ms is not None:
        said.append((_("Closest places"), f"{figures.closest_ms / 1000:.3f} s"))
    return said
