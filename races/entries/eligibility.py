"""Checks on entering a race and submitting to it: of groups, classes and teams, and of higher rooms."""

from collections.abc import Callable, Sequence
from datetime import datetime

from django.db import connection

from accounts.groups.selectors import is_in
from accounts.models import ClassLearner, Racer
from accounts.teams.services import team_of
from core.database.locks import hold
from paddock.errors import UserFault

from ..models import Entry, Race, TeamEntries

# Higher rooms add theirs when the site starts: each raises UserFault to refuse.
CHECKS: list[Callable[[Race, Racer, datetime], None]] = []
# Each reads for many races at once what a check needs.
READERS: list[Callable[[Sequence[Race], Racer], None]] = []


def read_for_checks(races: Sequence[Race], racer: Racer) -> None:
    """Read what :func:`refusal` needs for these races: as many queries for many races as for one. For pages only, as a
    write must not decide by what was read before it."""
    wanted = ["learner", "team_membership"] if any(race.team_entries for race in races) else ["learner"]
    known = racer._state.fields_cache
    if races and not known.keys() >= set(wanted):
        related = ("learner__classroom", "team_membership__team")
        found = Racer.objects.select_related(*related).only("pk", *related).get(pk=racer.pk)
        for name in wanted:
            known.setdefault(name, getattr(found, name, None))
    for reads in READERS:
        reads(races, racer)


def check_eligible(race: Race, racer: Racer, now: datetime) -> None:
    """Raise the UserFault of the first check that refuses. House cars race everywhere, outside the ranking."""
    if racer.is_house:
        return
    for check in CHECKS:
        check(race, racer, now)


def refusal(race: Race, racer: Racer, now: datetime) -> UserFault | None:
    """The fault that :func:`check_eligible` would raise, for pages that offer a race or show the reason against it."""
    try:
        check_eligible(race, racer, now)
    except UserFault as fault:
        return fault
    return None


def check_group(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a group's race to racers without a confirmed membership. Raises UserFault("race_group_only")."""
    if race.group is not None and not is_in(racer, race.group):
        raise UserFault("race_group_only", group=race.group.name)


def check_program(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse accounts of programs. Raises UserFault("race_program")."""
    if racer.is_program:
        raise UserFault("race_program")


def check_learner(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a class account in other races than its class's. Raises UserFault("race_not_of_class")."""
    learner: ClassLearner | None = getattr(racer, "learner", None)  # asked once for many races
    if learner is not None and (race.group_id is None or race.group_id != learner.classroom.group_id):
        raise UserFault("race_not_of_class")


def check_team(race: Race, racer: Racer, now: datetime) -> None:
    """Refuse a team race without a team, or to a second racer where each team has one car. Locks the team in a
    transaction. Raises UserFault("race_needs_team" | "race_team_has_entry")."""
    if not race.team_entries:
        return
    if connection.in_atomic_block or not Racer._meta.get_field("team_membership").is_cached(racer):
        team = team_of(racer)
    else:  # read for many races
        team = racer.team_membership.team if hasattr(racer, "team_membership") else None
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
