"""Permissions to see and act. Each predicate has an equivalent queryset; tests compare both."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeGuard

from django.db.models import Exists, F, OuterRef, Q, QuerySet

from accounts.groups.selectors import is_in
from accounts.models import GroupMember, Racer, Viewer
from evaluation.models import Evaluation

from ...models import Duel, Entry, Race, Submission, Timekeeper, Visibility
from ..engines import hidden_runs, is_hidden


@dataclass(frozen=True)
class RunAudience:
    """Racers of a room above who see runs that belong to no race. ``can_see`` and its twin ``seen``, of evaluations."""

    can_see: Callable[[Racer, Evaluation], bool]
    seen: Callable[[Racer], Q]


AUDIENCES: list[RunAudience] = []  # rooms above add theirs when the site starts


def can_organise(racer: Viewer, race: Race) -> bool:
    """Whether the racer may edit and cancel the race and remove racers: its organiser and admins."""
    return _known(racer) and (racer.is_staff or racer.pk == race.organiser_id)


def can_see_race(racer: Viewer, race: Race) -> bool:
    """Whether the racer may see the race. Twin of :func:`races_visible_to`. Public races: everybody. Others:
    organisers, timekeepers, admins, entered racers and members of its group, except removed racers."""
    if race.visibility == Visibility.PUBLIC or can_organise(racer, race):
        return True
    if not _known(racer):
        return False
    if race.physical and Timekeeper.objects.filter(race=race, racer_id=racer.pk).exists():
        return True
    removed = Entry.objects.filter(race=race, racer_id=racer.pk).values_list("removed_at", flat=True)
    if removed:
        return removed[0] is None
    return race.group_id is not None and is_in(racer, race.group_id)


def races_visible_to(racer: Viewer) -> QuerySet[Race]:
    """All races that the racer may see. Twin of :func:`can_see_race`."""
    races = Race.objects.select_related("track", "organiser")
    if not _known(racer):
        return races.filter(visibility=Visibility.PUBLIC)
    if racer.is_staff:
        return races
    member = Exists(Entry.objects.filter(race=OuterRef("pk"), racer_id=racer.pk, removed_at=None))
    invited = _in_its_group(racer, "")
    times = Exists(Timekeeper.objects.filter(race=OuterRef("pk"), racer_id=racer.pk))
    seen = Q(visibility=Visibility.PUBLIC) | Q(organiser_id=racer.pk) | Q(member) | invited
    return races.filter(seen | Q(physical=True) & Q(times))


def race_invited_to(token: str) -> Race | None:
    """The race that an invitation link with this token belongs to; None for a link that was reset or never was."""
    if not token:
        return None
    races = Race.objects.select_related("track", "organiser")
    return races.filter(invitation=token, visibility=Visibility.INVITATION).first()


def can_see_evaluation(racer: Viewer, evaluation: Evaluation) -> bool:
    """Whether the racer may see an evaluation: laps, line, trace. Twin of :func:`evaluations_visible_to`.

    Its owner, admins, the organisers of its race and registered audiences (:class:`RunAudience`); runs on a board,
    duels and runs shown live also everybody with access to that race. A rerun that does not count yet is for admins
    alone, a sealed run for nobody.
    """
    if evaluation.sealed:
        return False
    if _known(racer) and racer.is_staff:
        return True
    if is_hidden(evaluation):
        return False
    if _known(racer) and racer.pk == evaluation.owner_id:
        return True
    submission = Submission.objects.filter(evaluation=evaluation).select_related("entry__race").first()
    if submission is None:
        duel = Duel.objects.filter(evaluation=evaluation).select_related("race").first()
        if duel is not None:
            return can_see_race(racer, duel.race)
        return _known(racer) and any(audience.can_see(racer, evaluation) for audience in AUDIENCES)
    entry = submission.entry
    if can_organise(racer, entry.race):
        return True
    shown = entry.best_id == submission.pk or submission.is_live
    return shown and not entry.is_withdrawn and can_see_race(racer, entry.race)


def evaluations_visible_to(racer: Viewer) -> QuerySet[Evaluation]:
    """All evaluations that the racer may see. Twin of :func:`can_see_evaluation`."""
    evaluations = Evaluation.objects.select_related("owner", "model", "track")
    if _known(racer) and racer.is_staff:
        return evaluations
    driven = Submission.objects.filter(evaluation=OuterRef("pk"))
    duels = Duel.objects.filter(evaluation=OuterRef("pk"))
    shown = Q(Q(entry__best=F("pk")) | Q(is_live=True), entry__withdrawn_at=None)
    if not _known(racer):
        in_race = driven.filter(shown, entry__race__visibility=Visibility.PUBLIC)
        seen = Q(Exists(in_race)) | Q(Exists(duels.filter(race__visibility=Visibility.PUBLIC)))
        return evaluations.filter(~hidden_runs(), seen)
    # A database stops at the first condition that is true, so the most frequent one comes first
    organised = Q(entry__race__organiser_id=racer.pk)
    seen = Q(owner_id=racer.pk) | Q(Exists(driven.filter(shown & _shared_with(racer, "entry__race") | organised)))
    seen |= Q(Exists(duels.filter(_shared_with(racer, "race") | Q(race__organiser_id=racer.pk))))
    for audience in AUDIENCES:
        seen |= audience.seen(racer)
    return evaluations.filter(~hidden_runs(), seen)


def _shared_with(racer: Racer, to_race: str) -> Q:
    """Rows whose race, which ``to_race`` leads to, is public, or one that the racer entered or is invited to."""
    entered = Entry.objects.filter(race=OuterRef(to_race), racer_id=racer.pk, removed_at=None)
    return Q(**{f"{to_race}__visibility": Visibility.PUBLIC}) | Q(Exists(entered)) | _in_its_group(racer, to_race)


def _in_its_group(racer: Racer, to_race: str) -> Q:
    """Rows whose race, which ``to_race`` leads to, is one of a group that the racer is in and was not removed from."""
    of_mine = GroupMember.objects.filter(racer=racer.pk, confirmed_at__isnull=False).values("group")
    removed = Entry.objects.filter(race=OuterRef(to_race or "pk"), racer_id=racer.pk, removed_at__isnull=False)
    return Q(**{f"{to_race}__group__in" if to_race else "group__in": of_mine}) & ~Q(Exists(removed))


def _known(racer: Viewer) -> TypeGuard[Racer]:
    return racer is not None and racer.is_authenticated
