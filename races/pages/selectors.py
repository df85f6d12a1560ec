"""Cars on track and next in the queue, in races the reader may see; unfinished results are left out."""

from collections.abc import Sequence
from dataclasses import dataclass

from django.db.models import Case, Q, QuerySet, When
from django.utils import timezone

from accounts.models import Racer, Viewer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import Evaluation, State
from evaluation.running.queue.order import ORDER

from ..entries.selectors.visibility import races_visible_to
from ..live.selectors.events import LiveNow, live_for_all, live_now, live_of_race
from ..models import DuelCompetitor, Race, Visibility

SHOWN = 5
LOOKED_AT = 50  # of which most drive only where there are dozens of workers


@dataclass(frozen=True)
class CarOnTrack:
    """A run of a race: its racers and where to watch it; None where only its racer may."""

    run: Evaluation
    race: Race
    racers: Sequence[Racer]
    watched_by_all: bool


@dataclass(frozen=True)
class OnTrack:
    """``now``: runs that drive, the longest first; ``next``: those that wait, in the order of the queue, at most
    :data:`SHOWN` of each. ``live``: live events now or soon. ``for_all``: whether every reader sees this."""

    now: Sequence[CarOnTrack]
    next: Sequence[CarOnTrack]
    live: Sequence[LiveNow]
    for_all: bool

    def is_watched_by(self, racer: int | None) -> bool:
        """Whether a run is there that only this racer may watch."""
        return any(car.run.owner_id == racer and not car.watched_by_all for car in (*self.now, *self.next))


def track_of(race: int) -> OnTrack:
    """The cars on track in one race, for every reader who may see it: no query for a single reader."""

    def read() -> OnTrack:
        return _on_track(_runs_of_race(race=race), live_of_race(race, timezone.now()), for_all=True)

    return shared_value(("track of a race", race), read)


def on_track(reader: Viewer, races: Sequence[int] | None = None) -> OnTrack:
    """The cars on track in races that the reader may see. ``races``: ids of the only races that are asked for. No query
    for a single reader while all is in public races."""
    public = shared_value(("on track", None if races is None else tuple(races)), lambda: _in_public(races))
    if public.for_all or reader is None or not reader.is_authenticated:
        return public
    runs = _runs(races_visible_to(reader), races)
    return _on_track(runs, live_now(reader, timezone.now(), races), for_all=False)


def _in_public(races: Sequence[int] | None) -> OnTrack:
    now = timezone.now()
    runs, live = _runs(None, races), live_for_all(now, races)
    shown_in = [*map(_race_of, runs), *(each.event.race for each in live)]
    if all(race.visibility == Visibility.PUBLIC for race in shown_in):
        return _on_track(runs, live, for_all=True)
    return _on_track(_runs(races_visible_to(None), races), live_now(None, now, races), for_all=False)


def _runs(seen: QuerySet[Race] | None, races: Sequence[int] | None) -> list[Evaluation]:
    """The first runs that drive or wait, in the order of the queue. ``seen``: only of these races."""
    runs = _queue(seen)
    if races is not None:
        runs = runs.filter(Q(submission__entry__race__in=races) | Q(duel__race__in=races))
    return list(runs[:LOOKED_AT])


def _queue(seen: QuerySet[Race] | None = None) -> QuerySet[Evaluation]:
    alone = Q(submission__isnull=False, submission__entry__withdrawn_at=None, submission__is_void=False)
    duels = Q(duel__isnull=False)
    if seen is not None:
        pks = seen.order_by().values("pk")
        alone, duels = alone & Q(submission__entry__race__in=pks), duels & Q(duel__race__in=pks)
    runs = Evaluation.objects.filter(alone | duels, state__in=(State.RUNNING, State.QUEUED))
    runs = runs.select_related("owner", "submission__entry__race", "duel__race").defer("spec", "progress")
    return runs.order_by(Case(When(state=State.RUNNING, then=0), default=1), *ORDER)


_runs_of_race = KeptQuery(
    lambda race: _queue().filter(Q(submission__entry__race=race) | Q(duel__race=race))[:LOOKED_AT]
)


def _on_track(runs: Sequence[Evaluation], live: Sequence[LiveNow], *, for_all: bool) -> OnTrack:
    driving = sorted((run for run in runs if run.state == State.RUNNING), key=lambda run: (run.started_at, run.pk))
    driving = driving[:SHOWN]
    waiting = [run for run in runs if run.state == State.QUEUED][:SHOWN]
    meeting = _meeting([*driving, *waiting])
    cars = [_car(run, meeting) for run in driving], [_car(run, meeting) for run in waiting]
    return OnTrack(*cars, live, for_all)


def _meeting(runs: Sequence[Evaluation]) -> dict[int, list[Racer]]:
    duels = [run.duel.pk for run in runs if getattr(run, "duel", None) is not None]
    met: dict[int, list[Racer]] = {}
    if duels:
        cars = DuelCompetitor.objects.filter(duel__in=duels).select_related("entry__racer").order_by("duel", "pk")
        for car in cars:
            met.setdefault(car.duel_id, []).append(car.entry.racer)
    return met


def _car(run: Evaluation, meeting: dict[int, list[Racer]]) -> CarOnTrack:
    duel = getattr(run, "duel", None)
    racers = [run.owner] if duel is None else meeting.get(duel.pk, [run.owner])
    return CarOnTrack(run, _race_of(run), racers, duel is not None)


def _race_of(run: Evaluation) -> Race:
    duel = getattr(run, "duel", None)
    return run.submission.entry.race if duel is None else duel.race
