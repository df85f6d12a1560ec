"""In a sentence: whose a league race is, and how a racer comes into it."""

from __future__ import annotations

from decimal import Decimal
from typing import Protocol

from django.utils.translation import gettext as _
from django.utils.translation import ngettext


class SeasonNumbers(Protocol):
    """What a season says about promotion, finales and the championship."""

    promotion_percent: Decimal
    finale_size: int
    championship_places: int


def entry_rule(division: str, stage: str | None, season: SeasonNumbers | None) -> str:
    """Who may enter. ``stage`` and ``season``: None for a league race outside a season."""
    if stage == "pro-finale" and season is not None:
        return ngettext(
            "Finale: for the best racer of this month's pro race.",
            "Finale: for the best %(size)s racers of this month's pro race.",
            season.finale_size,
        ) % {"size": season.finale_size}
    if stage == "championship" and season is not None:
        return ngettext(
            "Championship: for the winner of each finale.",
            "Championship: for the first %(places)s of each finale.",
            season.championship_places,
        ) % {"places": season.championship_places}
    if division == "pro":
        if season is None:
            return _("Pro division: for racers promoted from an open race.")
        return _(
            "Pro division: finish in the best %(percent)s %% of a month's open race to be promoted and race here."
        ) % {"percent": f"{Decimal(season.promotion_percent).normalize():f}"}
    if division == "open":
        if season is None:
            return _("Open division: for everybody who has not been promoted yet.")
        return _("Open division: everybody starts here. The best %(percent)s %% are promoted to the pro division.") % {
            "percent": f"{Decimal(season.promotion_percent).normalize():f}"
        }
    return _("All divisions: everybody may enter.")
