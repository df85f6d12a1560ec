"""Whose the races are whose field is given."""

from __future__ import annotations

from ..models import ChampionshipPlace, FinalePlace, Round, Stage


def field_of(round_: Round) -> list[int] | None:
    """Ids of the racers in the field of a finale or a championship, the best placed first; None for other races.

    A finale's field comes from the official pro race of the same month, the championship's from all official finales.
    """
    if round_.stage == Stage.FINALE:
        places = FinalePlace.objects.filter(round__season=round_.season_id, round__number=round_.number)
        return list(places.order_by("place").values_list("racer", flat=True))
    if round_.stage == Stage.CHAMPIONSHIP:
        qualified = ChampionshipPlace.objects.filter(season=round_.season_id)
        return list(qualified.order_by("round__race__closes_at", "place").values_list("racer", flat=True))
    return None
