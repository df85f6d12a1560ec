"""Why a track is not imported, changed or taken away."""

from paddock.errors.reasons import gettext_noop as _
from paddock.errors.reasons import register

register(
    "Races",
    "user",
    {
        # tracks that racers import
        "track_known": _("This track already exists as %(name)s. Use that one."),
        "track_limit": _("You have reached the limit of %(limit)s imported tracks. Use one of them, or ask an admin."),
        "track_name": _("Give the track a name of 1 to %(limit)s characters on one line."),
        "track_look": _("Invalid look of a track. Choose one of: %(looks)s."),
        "track_slug": _(
            "The address %(slug)s cannot be used. Use lower-case letters, digits and hyphens; it must be new."
        ),
        "track_shape_unknown": _(
            "The shape of %(name)s is unknown: only its name was imported, with the results of a season."
        ),
        "track_in_use": _("Races or evaluations were driven on this track, so it stays."),
    },
)
