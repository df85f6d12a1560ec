"""The races that accept a model now, those most like its training first."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

from django.db.models import Case, Exists, Expression, F, FilteredRelation, OuterRef, Q, QuerySet, Value, When

from accounts.models import ClassLearner, Racer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import TrainedModel
from paddock.rules.race import EASIER_FIRST

from ...models import Entry, Race, RaceKind, Submission
from ...models.sensors import not_offered
from ..eligibility import read_for_checks, refusal
from .lists import open_races, racing_now

MOST = 12
LOOKED_AT = 60  # each may cost an eligibility check


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
    """A race that accepts a model, its run there if any, and whether track, direction and type equal its training's."""

    race: Race
    sent: Submission | None
    fits: bool


def offers_for(*, model: TrainedModel, racer: Racer, now: datetime, learned: Learned | None = None) -> list[Offer]:
    """At most :data:`MOST` open races that take this model or have it already, those most like ``learned`` first: the
    same track, direction and type; track and type; track; type."""
    if racer.pk is None:
        return []
    races = [race for race in open_races(now, racer) if not race.physical]
    if learned is not None:
        races = likest_first(races, learned)
    found = _entries_with(racer=racer.pk, network=model.network_id, now=now)
    entries = {entry.race_id: entry for entry in found}
    looked_at = [race for race in races if race.pk not in entries or not _is_gone(entries[race.pk], race)][:LOOKED_AT]
    read_for_checks(looked_at, racer)
    taken = [
        race for race in looked_at if not not_offered(model.sensors, race.sensors) and refusal(race, racer, now) is None
    ][:MOST]
    sent = {pk: _sent(entry) for pk, entry in entries.items()}
    return [Offer(race, sent.get(race.pk), _distance(race, learned) == 0) for race in taken]


def _open_entries(racer: Any, network: Any, now: Any) -> QuerySet[Entry]:
    """The racer's entries in races that are not over, the last with the first submission of the network there."""
    of_model = Q(submissions__network_id=network, submissions__is_void=False)
    entries = Entry.objects.filter(racer_id=racer, race__closes_at__gt=now)
    entries = entries.annotate(of_model=FilteredRelation("submissions", condition=of_model))
    return entries.select_related("of_model__evaluation").order_by("-of_model__submitted_at", "-of_model__pk")  # type: ignore[misc]


_entries_with = KeptQuery(_open_entries)


def _sent(entry: Entry) -> Submission | None:
    return getattr(entry, "of_model", None)  # Django sets no None here


def _is_gone(entry: Entry, race: Race) -> bool:
    """Whether the race takes neither a further car of the entry nor has the model already."""
    used_up = race.max_submissions is not None and entry.submission_count >= race.max_submissions
    return entry.withdrawn_at is not None or (used_up and _sent(entry) is None)


def beginners_races(
    *, racer: Racer | None, track_slug: str, direction: str, race_type: str, now: datetime
) -> QuerySet[Race]:
    """Open community races for a first car with this training: the house's first, then those with the fewest laps.
    ``racer``: only those open to them."""
    house_first = Case(When(organiser__is_house=True, then=Value(0)), default=Value(1))
    races = racing_now(now).filter(
        track__slug=track_slug,
        direction=direction,
        race_type=race_type,
        physical=False,
        group=None,
        team_entries="",
        kind=RaceKind.COMMUNITY,
    )
    if racer is not None:
        races = races.filter(~Exists(gone_from(racer.pk).filter(race=OuterRef("pk"))))
        races = races.filter(~Exists(ClassLearner.objects.filter(racer=racer.pk)))
    return races.order_by(house_first, *EASIER_FIRST, "closes_at", "pk")


def gone_from(racer: int | Expression) -> QuerySet[Entry]:
    """The racer's entries that take no further car: withdrawn, or without submissions left."""
    gone = Q(withdrawn_at__isnull=False) | Q(submission_count__gte=F("race__max_submissions"))
    return Entry.objects.filter(gone, racer_id=racer)


def enterable_now(now: datetime, racer: Racer) -> list[Race]:
    """The open races that a racer sees and may enter or is in."""
    races = [race for race in open_races(now, racer) if not race.physical]
    # of all racers: few are removed, and one query serves all readers
    removed = shared_value("removed from open races", lambda: _removed_racers(now))
    races = [race for race in races if (race.pk, racer.pk) not in removed]
    is_learner = hasattr(racer, "learner")
    limited = [
        race for race in races if is_learner or race.kind == RaceKind.LEAGUE or race.group_id or race.team_entries
    ]
    read_for_checks(limited, racer)
    closed = {race.pk for race in limited if refusal(race, racer, now) is not None}
    return [race for race in races if race.pk not in closed]


def _removed_racers(now: datetime) -> frozenset[tuple[int, int]]:
    removed = Entry.objects.filter(removed_at__isnull=False, race__closes_at__gt=now, race__cancelled_at=None)
    return frozenset(removed.order_by().values_list("race", "racer"))


def likest_first(races: Iterable[Race], learned: Learned) -> list[Race]:
    """The races in the order of :func:`offers_for`; among equals in the order that they have."""
    return sorted(races, key=lambda race: _distance(race, learned))


def _distance(race: Race, learned: Learned | None) -> int:
    """0: driven as ``learned`` in every respect, or nothing is known of it."""
    if learned is None:
        return 0
    same_type = race.race_type == learned.race_type
    if race.track_id != learned.track_id:
        return 3 if same_type else 4
    return (0 if race.direction == learned.direction else 1) if same_type else 2
