"""Races that are for some racers alone: who may enter them, beside what the league says."""

from __future__ import annotations

from datetime import datetime

from django.db import connection

from accounts.groups.selectors import is_in
from accounts.models import ClassLearner, Racer
from accounts.teams.services import team_of
from core.locks import hold
from paddock.errors import UserFault

from .models import Entry, Race, TeamEntries


def check_group(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a race of a group to whoever is not a confirmed member. Raises UserFault("race_group_only")."""
    if race.group is not None and not is_in(racer, race.group):
        raise UserFault("race_group_only", group=race.group.name)


def check_learner(race: Race, racer: Racer, now: datetime) -> None:
    """An account of a class races in races of its class alone, so that all of it can be deleted with the class. Raises
    UserFault("race_not_of_class")."""
    learner: ClassLearner | None = getattr(racer, "learner", None)  # asked once for many races
    if learner is not None and (race.group_id is None or race.group_id != learner.classroom.group_id):
        raise UserFault("race_not_of_class")


def check_team(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a race of teams to whoever is in none, and where a team has one car, to a second of one team.

    Raises UserFault("race_needs_team" | "race_team_has_entry"). Within a transaction the team is locked, so that two of
    one team do not enter at once.
    """
    if not race.team_entries:
        return
    team = team_of(racer)
    if team is None:
        raise UserFault("race_needs_team")
    if race.team_entries != TeamEntries.ONE:
        return
    if connection.in_atomic_block:
        hold(team)
    others = Entry.objects.filter(race=race, withdrawn_at=None, racer__team_membership__team=team).exclude(racer=racer)
    first = others.select_related("racer").order_by("pk").first()
    if first is not None:
        raise UserFault("race_team_has_entry", racer=first.racer.alias)
