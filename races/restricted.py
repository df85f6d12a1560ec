"""Races that are for some racers alone: who may enter them, beside what the league says."""

from __future__ import annotations

from datetime import datetime

from accounts.groups.selectors import is_in
from accounts.models import Racer
from paddock.errors import UserFault

from .models import Race


def check_group(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a race of a group to whoever is not a confirmed member. Raises UserFault("race_group_only")."""
    if race.group is not None and not is_in(racer, race.group):
        raise UserFault("race_group_only", group=race.group.name)
