"""Who races in which division. Registered with the race room when the site starts."""

from __future__ import annotations

from datetime import datetime

from faults import UserFault
from races.models import Division, Kind, Race

from .models import Racer
from .selectors import division_of, season_of


def check_division(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a league race of the division that the racer is not in. Community races are everybody's.

    Raises UserFault("race_pro_only" | "race_open_only").
    """
    if race.kind != Kind.LEAGUE:
        return
    division = division_of(season_of(race), racer)
    if race.division == division:
        return
    raise UserFault("race_pro_only" if race.division == Division.PRO else "race_open_only")
