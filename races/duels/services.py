"""Duels: the draw, the queueing of rounds, and the effect of a heat on the standings.

The draw freezes the seeds and writes a round robin's heats; :func:`drive_on` queues round after round, and writes those
of a bracket as they become known. Both are idempotent. Locks
are taken in the order evaluation, entries by their id, race, as everywhere in this room.
"""

import logging
from collections.abc import Mapping, Sequence
from datetime import datetime

from django.conf import settings
from django.db import transaction
from django.db.models import Min, QuerySet
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.after_commit import after_commit
from core.events import record
from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.services import queue_evaluation
from paddock.errors import UserFault

from ..boards.ranking import drawn_rank
from ..entries.engines import keeps_engine
from ..entries.time_checks import moment
from ..events import DUEL_DECIDED, DUELS_DRAWN, DUELS_OVER, of_race
from ..models import (
    Draw,
    Duel,
    DuelCompetitor,
    DuelFormat,
    DuelState,
    Entry,
    LiveEvent,
    Opponents,
    Race,
    RaceState,
    Submission,
)
from ..models.live import OVER, UNDO_FOR
from ..rules.layout import race_rules
from .bracket import Tie, bracket, deciders, heat_number, ties_won, winners_of
from .points import HeatDrive, places, points_lap_time
from .schedule import Heat, round_robin
from .selectors import drive_of

logger = logging.getLogger(__name__)
MAX_TRIES = 3  # runs of one heat that fail through our fault; each is itself tried EVALUATION_MAX_ATTEMPTS times
DUEL_PRIORITY = -1  # somebody who waits for a lap time comes first, house cars last
_STANDING = ("seed", "points", "duels", "duel_lap_ms", "rank_score", "rank_lap")


@audited("duels.drawn", _("Duels drawn"), target="race")
@transaction.atomic
def draw_duels(*, race: Race, now: datetime) -> Draw:
    """End a race's qualifying: seed the classified cars and write the heats. An earlier draw stays unchanged. Raises
    UserFault("race_has_no_duels"), "race_cancelled", "duels_before_closing", "duels_wait_for_qualifying" while a car
    that was sent in time is still waiting or driving, or the race is to be driven again with another engine."""
    if race.opponents != Opponents.MODELS or race.imported_at is not None:
        raise UserFault("race_has_no_duels")
    if race.cancelled_at is not None:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    if race.state_at(now) != RaceState.CLOSED:
        raise UserFault("duels_before_closing", closes=moment(race.closes_at))
    qualified = Entry.objects.filter(race=race, classified=True, withdrawn_at=None, is_baseline=False)
    entries = list(qualified.select_for_update(of=("self",)).order_by("pk"))
    race = Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    drawn = Draw.objects.filter(race=race).first()
    if drawn is not None:
        return drawn
    active = Submission.objects.filter(
        entry__race=race, entry__withdrawn_at=None, evaluation__state__in=(State.QUEUED, State.RUNNING)
    )
    # a draw is of one engine: until its runs are driven again with the site's, a race is still in its qualifying
    if count := active.count() or int(not keeps_engine(race)):
        raise UserFault("duels_wait_for_qualifying", count=count)
    is_bracket = race.duel_format == DuelFormat.BRACKET
    most = settings.DUELS_IN_BRACKET if is_bracket else settings.DUELS_IN_ROUND_ROBIN
    seeded = sorted(entries, key=lambda entry: entry.rank_key)[:most]
    for seed, entry in enumerate(seeded, start=1):
        entry.seed = seed
        entry.rank_score, entry.rank_lap = drawn_rank(0, None, seed)
    Entry.objects.bulk_update(seeded, _STANDING)
    drawn = Draw.objects.create(race=race, entrants=len(seeded), drawn_at=now)
    record(DUELS_DRAWN, at=now, **of_race(race), cars=len(seeded))
    if not is_bracket:
        by_seed = dict(enumerate(seeded, start=1))
        for number, heats in enumerate(round_robin(len(seeded), race.duel_cars), start=1):
            _write_heats(race, number, dict(enumerate(heats, start=1)), by_seed)
    return drawn


@transaction.atomic
def drive_on(*, race: Race, now: datetime) -> int:
    """Queue the heats that are due: those of the next round once the last is decided, and those to be repeated. Returns
    how many were queued. Once nothing is left, the duels are over, which is an event. Of a race that has a live event
    none are: the heats of the next round are written, and the event drives and decides them."""
    if _nothing_due(race):
        return 0
    entries = Entry.objects.filter(race=race, seed__isnull=False).select_related("racer", "best__evaluation__model")
    locked = entries.select_for_update(of=("self",)).order_by("pk")
    by_seed = {entry.seed: entry for entry in locked if entry.seed is not None}
    race = Race.objects.select_for_update(no_key=True, of=("self",)).select_related("track").get(pk=race.pk)
    draw = Draw.objects.filter(race=race).first()
    if draw is None or draw.over_at is not None or not keeps_engine(race):
        return 0
    # a live event drives the heats until it is over and its end can no longer be undone
    live = LiveEvent.objects.filter(race=race).exclude(state__in=OVER, last_at__lt=now - UNDO_FOR).exists()
    queued = 0
    while not _driving(race).exists():
        number = _first_open(race) or _next_round(race, by_seed)
        if number is None:
            recount(race, list(by_seed.values()))
            Draw.objects.filter(race=race).update(over_at=now)
            record(DUELS_OVER, at=now, **of_race(race))
            return queued
        if live:
            break
        queued += _queue_round(race, number, now)  # none if all of them are walkovers
    if not live and (number := _first_open(race)) is not None:
        queued += _queue_round(race, number, now)  # what stopped or failed in the round that is on
    recount(race, list(by_seed.values()))
    return queued


def drive_all_on(*, now: datetime) -> int:
    """Draw closed races and continue drawn ones. A failing race does not hold up the others. A race with live duels
    only is drawn by its live event or its organiser. Returns the number of queued heats."""
    queued = 0
    closed = Race.objects.filter(opponents=Opponents.MODELS, cancelled_at=None, imported_at=None, closes_at__lte=now)
    for race in closed.filter(draw__over_at=None).order_by("closes_at", "pk"):
        if race.duels_live_only and not Draw.objects.filter(race=race).exists():
            continue
        try:
            draw_duels(race=race, now=now)
            queued += drive_on(race=race, now=now)
        except UserFault as fault:
            logger.info("The duels of %s are not drawn yet: %s", race.slug, fault.code)
        except Exception:  # the other races' duels go on; this one is tried again at the next round of the task
            logger.exception("The duels of %s cannot go on.", race.slug)
    return queued


@transaction.atomic
def record_ended_duel(*, evaluation: Evaluation, result: Result | None, now: datetime) -> Duel | None:
    """Apply an evaluation that has just ended to its heat; None without a heat.

    Counted once: only the heat's present evaluation decides it, and only while the heat is driving. Without a result
    the heat is driven again, at most :data:`MAX_TRIES` times; then it is void and no car scores. After a run with
    another engine than the race's it is driven again without limit.
    """
    duel = Duel.objects.filter(evaluation=evaluation, state=DuelState.DRIVING).first()
    if duel is None:
        return None
    cars = list(duel.cars.select_related("entry").order_by("entry_id"))
    entries = list(
        Entry.objects.select_for_update(of=("self",)).filter(pk__in=[car.entry_id for car in cars]).order_by("pk")
    )
    if not Duel.objects.filter(pk=duel.pk, evaluation=evaluation, state=DuelState.DRIVING).exists():
        return None
    if result is not None and result.engine == duel.race.engine:
        _decide(duel, cars, result, now)
    elif result is not None:  # of another engine than all other heats: does not count as a try
        Duel.objects.filter(pk=duel.pk).update(state=DuelState.WAITING, tries=duel.tries - 1)
    else:
        _try_again(duel, entries, now)
    recount(duel.race, entries)
    duel.refresh_from_db()
    after_commit(_drive_on_safely, duel.race, now)
    return duel


def _drive_on_safely(race: Race, now: datetime) -> None:
    try:
        drive_on(race=race, now=now)
    except Exception:  # the result is recorded; the periodic task tries to go on again
        logger.exception("The duels of %s cannot go on.", race.slug)


def recount(race: Race, entries: Sequence[Entry]) -> None:
    """Recompute these drawn entries from the decided heats; the caller has locked them."""
    rows = DuelCompetitor.objects.filter(duel__race=race, duel__state=DuelState.DECIDED).select_related("duel")
    mine: dict[int, list[HeatDrive]] = {entry.pk: [] for entry in entries}
    for car in rows.filter(entry__in=[entry.pk for entry in entries]):
        mine[car.entry_id].append(drive_of(car))
    won = ties_won(bracket_of(race)) if race.duel_format == DuelFormat.BRACKET else None
    changed = []
    for entry in entries:
        if entry.seed is None:
            continue
        before = [getattr(entry, name) for name in _STANDING]
        total = points_lap_time(mine[entry.pk])
        entry.points = total.points if won is None else won.get(entry.seed, 0)
        entry.duels, entry.duel_lap_ms = len(mine[entry.pk]), total.lap_ms
        entry.rank_score, entry.rank_lap = drawn_rank(entry.points, entry.duel_lap_ms, entry.seed)
        if before != [getattr(entry, name) for name in _STANDING]:
            changed.append(entry)
    Entry.objects.bulk_update(changed, _STANDING)


def bracket_of(race: Race) -> list[list[Tie]]:
    """The tree of a drawn bracket as it stands, by round."""
    return bracket(Draw.objects.get(race=race).entrants, winners_of(_decided_heats(race), race.duel_heats))


def _decided_heats(race: Race) -> dict[tuple[int, int], dict[int, HeatDrive]]:
    """The drives by seed in the heats of a bracket, by round and number. Empty for a void heat."""
    heats: dict[tuple[int, int], dict[int, HeatDrive]] = {}
    for car in DuelCompetitor.objects.filter(duel__race=race, duel__decided_at__isnull=False).select_related(
        "duel", "entry"
    ):
        assert car.entry.seed is not None, "it was drawn"
        heats.setdefault((car.duel.round, car.duel.number), {})[car.entry.seed] = drive_of(car)
    return heats


def _nothing_due(race: Race) -> bool:
    """Whether a look without locks shows that there is nothing to do: most results end here."""
    draw = Draw.objects.filter(race=race).first()
    if draw is None or draw.over_at is not None:
        return True
    number = _first_open(race)
    due = Duel.objects.filter(race=race, round=number, state=DuelState.WAITING) if number else Duel.objects.none()
    return _driving(race).exists() and not due.exists()


def _first_open(race: Race) -> int | None:
    """The round that is on: the first with a heat that is not decided."""
    open_ = Duel.objects.filter(race=race, state__in=(DuelState.WAITING, DuelState.DRIVING))
    return open_.aggregate(first=Min("round"))["first"]


def _driving(race: Race) -> QuerySet[Duel]:
    return Duel.objects.filter(race=race, state=DuelState.DRIVING)


def _next_round(race: Race, by_seed: Mapping[int, Entry]) -> int | None:
    """Write the next round of a bracket whose heats are all decided, or the third heats of its last round; None when
    there is none."""
    if race.duel_format != DuelFormat.BRACKET:
        return None
    legs = race.duel_heats
    third = deciders(_decided_heats(race), legs)
    if third:
        last = max(round_ for round_, _ in third)
        _write_heats(race, last, {number: heat for (round_, number), heat in third.items() if round_ == last}, by_seed)
        return last
    written = set(Duel.objects.filter(race=race).values_list("round", flat=True))
    for number, ties in enumerate(bracket_of(race), start=1):
        if number not in written:
            heats = {
                heat_number(tie.number, leg, legs): heat for tie in ties for leg, heat in enumerate(tie.heats(legs))
            }
            _write_heats(race, number, heats, by_seed)
            return number
    return None


def _write_heats(race: Race, round_: int, heats: Mapping[int, Heat], by_seed: Mapping[int, Entry]) -> None:
    duels = Duel.objects.bulk_create(Duel(race=race, round=round_, number=number) for number in heats)
    DuelCompetitor.objects.bulk_create(
        DuelCompetitor(duel=duel, entry=by_seed[seed], grid=grid)
        for duel, heat in zip(duels, heats.values(), strict=True)
        for grid, seed in enumerate(heat, start=1)
    )


def _queue_round(race: Race, round_: int, now: datetime) -> int:
    """Queue the heats of a round that wait; those with fewer than two cars left are decided at once."""
    duels = Duel.objects.filter(race=race, round=round_, state=DuelState.WAITING).order_by("number")
    return sum(_queue(race, duel, now) for duel in duels)


def _queue(race: Race, duel: Duel, now: datetime) -> bool:
    starting = starting_cars(duel)
    if len(starting) < 2:
        walk_over(race=race, duel=duel, now=now)
        return False
    front, *others = (counted_run(car.entry).evaluation.model for car in starting)
    evaluation = queue_evaluation(
        owner=front.owner,
        model=front,
        track=race.track,
        rules=race_rules(race),
        rivals=others,
        priority=DUEL_PRIORITY,
        now=now,
    )
    Duel.objects.filter(pk=duel.pk).update(state=DuelState.DRIVING, evaluation=evaluation, tries=duel.tries + 1)
    return True


def starting_cars(duel: Duel) -> list[DuelCompetitor]:
    """The cars of a heat whose racers are still in the race, the front one first. That the others are not is noted."""
    cars = list(duel.cars.select_related("entry__racer", "entry__best__evaluation__model__owner").order_by("grid"))
    for car in cars:
        car.forfeited = car.entry.is_withdrawn
    DuelCompetitor.objects.bulk_update(cars, ["forfeited"])
    return [car for car in cars if not car.forfeited]


def walk_over(*, race: Race, duel: Duel, now: datetime) -> None:
    """Decide a heat of fewer than two cars without driving it. The caller updates the standings."""
    cars = list(duel.cars.order_by("grid"))
    _place(cars, sorted(cars, key=lambda car: (car.forfeited, car.grid)))
    Duel.objects.filter(pk=duel.pk).update(state=DuelState.DECIDED, decided_at=now, evaluation=None)
    record(DUEL_DECIDED, at=now, **of_race(race), round=duel.round, number=duel.number)


def counted_run(entry: Entry) -> Submission:
    """The standing that seeded a drawn entry."""
    assert entry.best is not None, "only who has a result is drawn"
    return entry.best


def _decide(duel: Duel, cars: list[DuelCompetitor], result: Result, now: datetime) -> None:
    """Write places and points from the result: car 0 of the run stood in front of those that started."""
    grid = sorted(cars, key=lambda car: car.grid)
    starting = [car for car in grid if not car.forfeited]
    driven = {0: result, **{rival.number: rival for rival in result.rivals.all()}}
    for number, car in enumerate(starting):
        complete = [lap["time_ms"] for lap in driven[number].laps if lap["complete"]]
        car.laps, car.time_ms = len(complete), sum(complete)
        car.retired_code = driven[number].retired_code
    _place(cars, [starting[number] for number in result.order] + [car for car in grid if car.forfeited])
    Duel.objects.filter(pk=duel.pk).update(state=DuelState.DECIDED, decided_at=now)
    record(DUEL_DECIDED, at=now, **of_race(duel.race), round=duel.round, number=duel.number)


def _place(cars: list[DuelCompetitor], order: list[DuelCompetitor]) -> None:
    """Write places and points for the cars of a heat as they stand in ``order``."""
    given = places([car.pk for car in order], lost=[car.pk for car in order if car.is_lost])
    for car in cars:
        car.place, car.points = given[car.pk]
    DuelCompetitor.objects.bulk_update(cars, ["place", "points", "laps", "time_ms", "retired_code"])


def _try_again(duel: Duel, entries: list[Entry], now: datetime) -> None:
    """A run without a result: once more, or never again. One stopped because a racer left costs no try."""
    assert duel.evaluation is not None, "its run has just ended"
    left = any(entry.is_withdrawn for entry in entries)
    tries = duel.tries - 1 if left and duel.evaluation.state == State.STOPPED else duel.tries
    if tries < MAX_TRIES:
        Duel.objects.filter(pk=duel.pk).update(state=DuelState.WAITING, tries=tries)
        return
    logger.error("Duel %s is void: %s runs ended without a result.", duel, duel.tries)
    Duel.objects.filter(pk=duel.pk).update(state=DuelState.VOID, decided_at=now)
