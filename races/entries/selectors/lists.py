"""Lists of races and of a racer's results in them."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from datetime import datetime
from functools import reduce
from operator import or_

from django.db.models import Case, OuterRef, Q, QuerySet, Value, When

from accounts.models import GroupMember, Racer, Viewer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import Evaluation
from tracks.models import Track

from ...boards.ranking import Standing, standing_in
from ...boards.selectors.board import ranks_of
from ...boards.selectors.counts import racers_on_board
from ...models import Entry, Race, RaceKind, Redrive, Submission, Timekeeper, Visibility
from .visibility import races_visible_to

HISTORY_LENGTH = 50


@dataclass(frozen=True)
class SubmissionRow:
    """One submission and its result: None while it waits or drives, and when it ended without one."""

    submission: Submission
    standing: Standing | None
    is_best: bool


@dataclass(frozen=True)
class HistoryRow:
    """One race of a racer. ``rank``: None for baselines and unclassified entries."""

    entry: Entry
    race: Race
    rank: int | None


STATES = ("open", "upcoming", "closed", "cancelled")


def in_state(state: str, now: datetime) -> Q:
    """Races in one of the :data:`STATES`."""
    if state == "cancelled":
        return Q(cancelled_at__isnull=False)
    times = {
        "open": Q(opens_at__lte=now, closes_at__gt=now),
        "upcoming": Q(opens_at__gt=now),
        "closed": Q(closes_at__lte=now),
    }
    return Q(cancelled_at=None) & times[state]


_LEAGUE_FIRST = Case(When(kind=RaceKind.LEAGUE, then=Value(0)), default=Value(1))
_ORDERS: dict[str, tuple[str | Case, ...]] = {
    "open": (_LEAGUE_FIRST, "closes_at", "pk"),
    "upcoming": ("opens_at", _LEAGUE_FIRST, "pk"),
    "closed": ("-closes_at", _LEAGUE_FIRST, "pk"),
    "cancelled": ("-cancelled_at", "pk"),
}


def races_in(state: str, now: datetime, racer: Viewer = None) -> QuerySet[Race]:
    """Races in one of the :data:`STATES` that the racer may see, the next or the latest first, with ``entry_count``."""
    return _counted(races_visible_to(racer)).filter(in_state(state, now)).order_by(*_ORDERS[state])


def racing_now(now: datetime, racer: Viewer = None) -> QuerySet[Race]:
    """Open races that the racer may see: the league's first, then by closing, with ``entry_count``."""
    return races_in("open", now, racer)


def open_races(now: datetime, racer: Viewer = None) -> list[Race]:
    """Copies of :func:`racing_now` for a page; one query for all readers where these are public races only."""
    if not sees_only_public(racer, ("open",), now):
        return list(racing_now(now, racer).select_related("group"))
    races = shared_value("open races", lambda: list(racing_now(now).select_related("group")))
    return [copy(race) for race in races if race.closes_at > now]


def sees_only_public(racer: Viewer, states: Sequence[str], now: datetime) -> bool:
    """Whether a racer sees the same races in these states as guests do: no query for a single racer."""
    if racer is None or not racer.is_authenticated:
        return True
    wanted = reduce(or_, (in_state(state, now) for state in states)) & ~Q(visibility=Visibility.PUBLIC)
    others = shared_value(("readers of other races", *states), lambda: _readers_of(Race.objects.filter(wanted)))
    return not others if racer.is_staff else racer.pk not in others


def _readers_of(races: QuerySet[Race]) -> frozenset[int]:
    """Everybody but admins who may see one of these races that are not public, and perhaps a few who may not."""
    races = races.order_by()
    entered = Entry.objects.filter(race__in=races.values("pk"), removed_at=None).order_by().values_list("racer")
    members = GroupMember.objects.filter(group__in=races.values("group"), confirmed_at__isnull=False).order_by()
    timekeepers = Timekeeper.objects.filter(race__in=races.values("pk"), race__physical=True).order_by()
    others = (entered, members.values_list("racer"), timekeepers.values_list("racer"))
    return frozenset(pk for (pk,) in races.values_list("organiser").union(*others))


def races_on(track: Track, now: datetime, racer: Viewer = None) -> QuerySet[Race]:
    """Races on a track that the racer may see: open ones, upcoming ones, closed ones, cancelled ones."""
    races = races_visible_to(racer).filter(track=track)
    cancelled, opens, closes = Q(cancelled_at__isnull=False), Q(opens_at__gt=now), Q(closes_at__gt=now)
    first = Case(When(cancelled, then=3), When(opens, then=1), When(closes, then=0), default=2)
    soonest = Case(When(opens, then="opens_at"), When(closes, then="closes_at"))
    return races.order_by(first, soonest, "-closes_at", "pk")


def organised_by(racer: Racer, seen: QuerySet[Race]) -> QuerySet[Race]:
    """Races among ``seen`` that ``racer`` organises, the newest first."""
    return seen.filter(organiser=racer).order_by("-opens_at", "pk")


def races_of(racer: Racer) -> QuerySet[Race]:
    """Races that the racer is in, the last to close first."""
    mine = Entry.objects.filter(racer=racer, withdrawn_at=None).values("race")
    return _counted(races_visible_to(racer)).filter(pk__in=mine).order_by("-closes_at", "pk")


_entries = KeptQuery(
    lambda race, racer: Entry.objects.filter(race_id=race, racer_id=racer).select_related("best__evaluation").order_by()
)


def entry_of(race: Race, racer: Viewer) -> Entry | None:
    """The racer's entry in a race, also a withdrawn one; None if there never was one."""
    if racer is None or not racer.is_authenticated:
        return None
    entry = next(iter(_entries(race=race.pk, racer=racer.pk)), None)
    if entry is not None:
        entry.race, entry.racer = race, racer
    return entry


def submissions_of(entry: Entry) -> list[SubmissionRow]:
    """All submissions of an entry with their results, the newest first."""
    rows = []
    related = ("evaluation__result", "evaluation__model", "evaluation__track", "evaluation__owner")
    for submission in entry.submissions.select_related(*related).order_by("-number"):
        result = getattr(submission.evaluation, "result", None)
        standing = None if result is None else standing_in(entry.race, result.laps)
        rows.append(SubmissionRow(submission, standing, submission.pk == entry.best_id))
    return rows


def replaced_by(evaluation: Evaluation) -> Redrive | None:
    """The rerun that counts in place of this run; None if there is none."""
    related = ("evaluation__result", "submission__entry__race")
    return Redrive.objects.filter(replaced=evaluation).select_related(*related).first()


def racer_history(racer: Racer, seen: QuerySet[Race], limit: int = HISTORY_LENGTH) -> list[HistoryRow]:
    """The racer's races among ``seen``, the last to close first, with the rank in each."""
    entries = list(
        Entry.objects.filter(racer=racer, withdrawn_at=None, race__in=seen.order_by().values("pk"))
        .select_related("race__track", "best__evaluation")
        .order_by("-race__closes_at", "-pk")[:limit]
    )
    ranks = ranks_of(entries)
    return [HistoryRow(entry, entry.race, ranks[entry.pk]) for entry in entries]


def _counted(races: QuerySet[Race]) -> QuerySet[Race]:
    return races.annotate(entry_count=racers_on_board(OuterRef("pk")))
