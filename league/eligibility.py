"""Who races in which division. Registered with the race room when the site starts."""

from __future__ import annotations

from datetime import datetime

from accounts.models import Racer
from paddock.errors import UserFault
from races.models import Division, Race, RaceKind

from .models.season import WITH_FIELD
from .selectors import field_of
from .selectors.boards import round_of


def check_division(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a league race of the division that the racer is not in, and a given field to everybody outside it.

    Community races and races of all divisions are everybody's. A round that is due counts once it is official: a check
    writes nothing. Raises UserFault("race_pro_only" | "race_open_only" | "race_not_in_field").
    """
    if race.kind != RaceKind.LEAGUE or race.division == Division.ALL:
        return
    round_ = round_of(race, racer)
    division = Division.OPEN
    if round_ is not None:
        if round_.reader_division:
            division = Division(round_.reader_division)
        if round_.stage in WITH_FIELD:
            if racer.pk not in (field_of(round_) or []):
                raise UserFault("race_not_in_field")
            return
    if race.division == division:
        return
    raise UserFault("race_pro_only" if race.division == Division.PRO else "race_open_only")
