"""Why duels cannot be drawn."""

from .reason import gettext_noop as _
from .reason import table

REASONS = table(
    "user",
    {
        "race_has_no_duels": _("This race has no duels. Only a head-to-head race against other racers' cars has."),
        "race_bracket_of_pairs": _("In a bracket two cars meet at a time. Choose 2 cars in a duel, or a round robin."),
        "duels_before_closing": _("The duels are drawn once the race has closed, at %(closes)s."),
        "duels_wait_for_qualifying": _(
            "Cars that were sent in time (%(count)s) are still being timed. The duels are drawn when they are done."
        ),
        "duels_drawn": _("The duels are drawn, so the qualifying does not change any more."),
    },
)
