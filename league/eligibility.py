"""Who races in which division. Registered with the race room when the site starts."""

from __future__ import annotations

from datetime import datetime

from accounts.models import Racer
from paddock.errors import UserFault
from races.models import Division, Kind, Race

from .models.season import WITH_FIELD
from .selectors import division_of, field_of
from .selectors.boards import round_of
from .services.closing import close_due_rounds


def check_division(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a league race of the division that the racer is not in, and a given field to everybody outside it.

    Community races and races of all divisions are everybody's. What is due becomes official first, so that nobody
    depends on a scheduler. Raises UserFault("race_pro_only" | "race_open_only" | "race_not_in_field").
    """
    if race.kind != Kind.LEAGUE or race.division == Division.ALL:
        return
    round_ = round_of(race, racer, now)
    division = Division.OPEN
    if round_ is not None:
        if round_.waits:
            close_due_rounds(now=now, season=round_.season)
            division = division_of(round_.season, racer)
        elif round_.reader_division:
            division = Division(round_.reader_division)
        if round_.stage in WITH_FIELD:
            if racer.pk not in (field_of(round_) or []):
                raise UserFault("race_not_in_field")
            return
    if race.division == division:
        return
    raise UserFault("race_pro_only" if race.division == Division.PRO else "race_open_only")
