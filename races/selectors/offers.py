"""Which races a model can be sent to now, those first that are like what it has learned."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Protocol

from django.db.models import Case, Exists, F, OuterRef, Q, QuerySet, Value, When

from accounts.classes import is_learner
from accounts.models import ClassLearner
from evaluation.models import TrainedModel
from paddock.rules.race import EASIER_FIRST

from ..eligibility import refusal
from ..models import Entry, Race, RaceKind, Submission, Visibility
from ..sensors import not_offered
from .lists import racing_now

if TYPE_CHECKING:
    from accounts.models import Racer

MOST = 12
LOOKED_AT = 60  # each may cost a look at who may enter it


class Learned(Protocol):
    """Where a model has learned to drive: a training has these."""

    @property
    def track_id(self) -> int: ...

    @property
    def direction(self) -> str: ...

    @property
    def race_type(self) -> str: ...


@dataclass(frozen=True)
class Offer:
    """A race that a model can be sent to, its run there if it was sent already, and whether the race is what it was
    trained for: the same track, direction and race type."""

    race: Race
    sent: Submission | None
    fits: bool


def offers_for(*, model: TrainedModel, racer: Racer, now: datetime, learned: Learned | None = None) -> list[Offer]:
    """At most :data:`MOST` races that take this car of the racer at ``now``: that they may enter, that offer its
    sensors and where a submission is left, or that it was sent to already.

    Those come first that are like ``learned``: the same track, direction and type, then the same track and type, the
    same track, the same type, and the others; among equals the league's, and then those that close first.
    """
    if racer.pk is None:
        return []
    mine = Entry.objects.filter(race=OuterRef("pk"), racer_id=racer.pk)
    sent_there = Submission.objects.filter(
        entry__race=OuterRef("pk"), entry__racer_id=racer.pk, network_id=model.network_id, is_void=False
    )
    left, used_up = (
        mine.filter(withdrawn_at__isnull=False),
        mine.filter(submission_count__gte=F("race__max_submissions")),
    )
    races = (
        racing_now(now, racer)
        .filter(physical=False)
        .filter(~Exists(left))
        .filter(~Exists(used_up) | Exists(sent_there))
    )
    if learned is not None:
        races = likest_first(races, learned)
    taken = [
        race
        for race in races[:LOOKED_AT]
        if not not_offered(model.sensors, race.sensors) and refusal(race, racer, now) is None
    ][:MOST]
    sent = Submission.objects.filter(
        entry__race__in=taken, entry__racer_id=racer.pk, network_id=model.network_id, is_void=False
    ).select_related("evaluation", "entry")
    by_race = {submission.entry.race_id: submission for submission in sent}
    return [Offer(race, by_race.get(race.pk), _fits(race, learned)) for race in taken]


def beginners_races(*, racer: Racer, track_slug: str, direction: str, race_type: str, now: datetime) -> QuerySet[Race]:
    """Open races of the community that a racer's first car may go to, trained for this track, direction and type: those
    of the house first, then those that ask for the fewest laps. Whether they take its sensors is not looked at."""
    mine = Entry.objects.filter(race=OuterRef("pk"), racer_id=racer.pk)
    gone = mine.filter(Q(withdrawn_at__isnull=False) | Q(submission_count__gte=F("race__max_submissions")))
    house_first = Case(When(organiser__is_house=True, then=Value(0)), default=Value(1))
    races = racing_now(now, racer).filter(
        ~Exists(gone),
        ~Exists(ClassLearner.objects.filter(racer=racer.pk)),
        track__slug=track_slug,
        direction=direction,
        race_type=race_type,
        visibility=Visibility.PUBLIC,
        physical=False,
        group=None,
        team_entries="",
        kind=RaceKind.COMMUNITY,
    )
    return races.order_by(house_first, *EASIER_FIRST, "closes_at", "pk")


def enterable_now(now: datetime, racer: Racer) -> QuerySet[Race]:
    """The open races that a racer sees and may enter or is in: not those of another division, of a field that they are
    not in, or that they were removed from."""
    races = (
        racing_now(now, racer)
        .filter(physical=False)
        .filter(~Exists(Entry.objects.filter(race=OuterRef("pk"), racer_id=racer.pk, removed_at__isnull=False)))
    )
    limited = races.filter(Q(kind=RaceKind.LEAGUE) | Q(group__isnull=False) | ~Q(team_entries=""))
    if is_learner(racer):
        limited = races
    closed = [race.pk for race in limited if refusal(race, racer, now) is not None]
    return races.exclude(pk__in=closed)


def likest_first(races: QuerySet[Race], learned: Learned) -> QuerySet[Race]:
    """The races in the order of :func:`offers_for`; among equals in the order that they have."""
    return races.order_by(_distance(learned), *races.query.order_by)


def _fits(race: Race, learned: Learned | None) -> bool:
    if learned is None:
        return True
    told = (race.track_id, race.direction, race.race_type)
    return told == (learned.track_id, learned.direction, learned.race_type)


def _distance(learned: Learned) -> Case:
    same_type, same_track = Q(race_type=learned.race_type), Q(track_id=learned.track_id)
    return Case(
        When(same_track & same_type & Q(direction=learned.direction), then=Value(0)),
        When(same_track & same_type, then=Value(1)),
        When(same_track, then=Value(2)),
        When(same_type, then=Value(3)),
        default=Value(4),
    )
