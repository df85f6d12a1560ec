"""Lists of races and of what a racer has done in them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, TypeAlias

from django.db.models import Case, OuterRef, Q, QuerySet, Value, When

from ..models import Entry, Race, RaceKind, Redrive, Submission
from ..ranking import Standing, standing_in
from .boards import ranks_of
from .counting import racers_on_board
from .visibility import races_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer
    from evaluation.models import Evaluation
    from tracks.models import Track

    Reader: TypeAlias = Racer | AnonymousUser | None

HISTORY_LENGTH = 50


@dataclass(frozen=True)
class SubmissionRow:
    """One submission and what it is worth: None while it waits or drives, and when it ended without a result."""

    submission: Submission
    standing: Standing | None
    is_best: bool


@dataclass(frozen=True)
class HistoryRow:
    """One race of a racer. ``rank``: None for a baseline and for who is not classified."""

    entry: Entry
    race: Race
    rank: int | None


def racing_now(now: datetime, racer: Reader = None) -> QuerySet[Race]:
    """Races that take cars at ``now`` and that the racer may see: the league's first, then those that close first.

    Each race has ``entry_count``, the racers in it without baselines; so in all lists below.
    """
    races = _counted(races_visible_to(racer)).filter(cancelled_at=None, opens_at__lte=now, closes_at__gt=now)
    return races.order_by(_league_first(), "closes_at", "pk")


def upcoming(now: datetime, racer: Reader = None) -> QuerySet[Race]:
    """Races that open after ``now`` and that the racer may see, the next one first."""
    races = _counted(races_visible_to(racer)).filter(cancelled_at=None, opens_at__gt=now)
    return races.order_by("opens_at", _league_first(), "pk")


def closed_races(now: datetime, racer: Reader = None) -> QuerySet[Race]:
    """Races that have closed by ``now`` and that the racer may see, the latest first."""
    races = _counted(races_visible_to(racer)).filter(cancelled_at=None, closes_at__lte=now)
    return races.order_by("-closes_at", _league_first(), "pk")


def cancelled_races(racer: Reader = None) -> QuerySet[Race]:
    """Cancelled races that the racer may see, the last cancelled first."""
    return _counted(races_visible_to(racer)).filter(cancelled_at__isnull=False).order_by("-cancelled_at", "pk")


def races_on(track: Track, now: datetime, racer: Reader = None) -> QuerySet[Race]:
    """Races on a track that the racer may see: what takes cars at ``now`` first, the next to close before the others;
    then what opens, the next one first; then what has closed, the latest first; cancelled ones last."""
    races = races_visible_to(racer).filter(track=track)
    cancelled, opens, closes = Q(cancelled_at__isnull=False), Q(opens_at__gt=now), Q(closes_at__gt=now)
    first = Case(When(cancelled, then=3), When(opens, then=1), When(closes, then=0), default=2)
    soonest = Case(When(opens, then="opens_at"), When(closes, then="closes_at"))
    return races.order_by(first, soonest, "-closes_at", "pk")


def organised_by(racer: Racer, viewer: Reader = None) -> QuerySet[Race]:
    """Races that ``racer`` organises and ``viewer`` may see, the newest first."""
    return _counted(races_visible_to(viewer)).filter(organiser=racer).order_by("-opens_at", "pk")


def races_of(racer: Racer) -> QuerySet[Race]:
    """Races that the racer is in, the last to close first."""
    mine = Entry.objects.filter(racer=racer, withdrawn_at=None).values("race")
    return _counted(races_visible_to(racer)).filter(pk__in=mine).order_by("-closes_at", "pk")


def entry_of(race: Race, racer: Reader) -> Entry | None:
    """The racer's entry in a race, also a withdrawn one; None if there never was one."""
    if racer is None or not racer.is_authenticated:
        return None
    entry = Entry.objects.filter(race=race, racer_id=racer.pk).select_related("racer", "best__evaluation").first()
    if entry is not None:
        entry.race = race
    return entry


def submissions_of(entry: Entry) -> list[SubmissionRow]:
    """All submissions of an entry, the newest first, each with what it is worth."""
    rows = []
    related = ("evaluation__result", "evaluation__model", "evaluation__track", "evaluation__owner")
    for submission in entry.submissions.select_related(*related).order_by("-number"):
        result = getattr(submission.evaluation, "result", None)
        standing = None if result is None else standing_in(entry.race, result.laps)
        rows.append(SubmissionRow(submission, standing, submission.pk == entry.best_id))
    return rows


def replaced_by(evaluation: Evaluation) -> Redrive | None:
    """The run, with its result, that counts in a race since this one was driven again with another engine; None for
    every other."""
    related = ("evaluation__result", "submission__entry__race")
    return Redrive.objects.filter(replaced=evaluation).select_related(*related).first()


def racer_history(racer: Racer, viewer: Reader = None, limit: int = HISTORY_LENGTH) -> list[HistoryRow]:
    """The racer's races that ``viewer`` may see, the last to close first, with the rank in each."""
    entries = list(
        Entry.objects.filter(racer=racer, withdrawn_at=None, race__in=races_visible_to(viewer).order_by().values("pk"))
        .select_related("race__track", "best__evaluation")
        .order_by("-race__closes_at", "-pk")[:limit]
    )
    ranks = ranks_of(entries)
    return [HistoryRow(entry, entry.race, ranks[entry.pk]) for entry in entries]


def _counted(races: QuerySet[Race]) -> QuerySet[Race]:
    return races.annotate(entry_count=racers_on_board(OuterRef("pk")))


def _league_first() -> Case:
    return Case(When(kind=RaceKind.LEAGUE, then=Value(0)), default=Value(1))
