"""Why a car may not race along with others."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "rivals_race_type": _("Other cars race along in head-to-head only. Choose the race type head_to_head."),
        "rivals_with_bots": _("Submitted cars race each other without bot cars. Set the number of bot cars to 0."),
        "car_number": _("There is no car %(car)s in this evaluation. Ask for one of these numbers: %(known)s."),
        "too_many_rivals": _("At most %(limit)s other cars may race along. Leave some of them out."),
    },
)
