"""Who is on track now, and who is next: of races that the reader may see, whose board tells of every car anyway. What a
car has driven so far is its racer's business until it counts, and is not told here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from django.db.models import Case, Q, When

from evaluation.models import Evaluation, State
from evaluation.queue_order import ORDER

from ..models import DuelCompetitor, Race
from .visibility import races_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

SHOWN = 5
LOOKED_AT = 50  # of which most drive only where there are dozens of workers


@dataclass(frozen=True)
class CarOnTrack:
    """A run of a race: who drives, and where one may watch; None where only its racer may."""

    run: Evaluation
    race: Race
    racers: Sequence[Racer]
    is_duel: bool
    watched_by_all: bool


@dataclass(frozen=True)
class OnTrack:
    """``now``: runs that drive, the longest first; ``next``: those that wait, in the order of the queue."""

    now: list[CarOnTrack] = field(default_factory=list)
    next: list[CarOnTrack] = field(default_factory=list)


def on_track(reader: Racer | AnonymousUser | None, races: Iterable[int] | None = None) -> OnTrack:
    """The first :data:`SHOWN` of each. ``races``: ids of the only races that are asked for. Two queries at most."""
    seen = races_visible_to(reader).order_by().values("pk")
    if races is not None:
        seen = seen.filter(pk__in=list(races))
    alone = Q(submission__entry__race__in=seen, submission__entry__withdrawn_at=None, submission__is_void=False)
    runs = Evaluation.objects.filter(alone | Q(duel__race__in=seen))
    runs = runs.select_related("owner", "submission__entry__race", "duel__race")
    runs = runs.filter(state__in=(State.RUNNING, State.QUEUED)).defer("spec", "progress")
    found = list(runs.order_by(Case(When(state=State.RUNNING, then=0), default=1), *ORDER)[:LOOKED_AT])
    driving = sorted((run for run in found if run.state == State.RUNNING), key=lambda run: (run.started_at, run.pk))
    driving = driving[:SHOWN]
    waiting = [run for run in found if run.state == State.QUEUED][:SHOWN]
    meeting = _meeting([*driving, *waiting])
    return OnTrack([_car(run, meeting) for run in driving], [_car(run, meeting) for run in waiting])


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
    if duel is not None:
        return CarOnTrack(run, duel.race, meeting.get(duel.pk, [run.owner]), True, True)
    return CarOnTrack(run, run.submission.entry.race, [run.owner], False, False)
