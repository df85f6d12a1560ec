"""Reruns of races when the site's engine changes, because lap times of two engines do not compare.

A finished race keeps the engine of its results; every other race is driven again (docs/operators.md, "A new engine").
Each counted run is queued again as it was frozen, as a :class:`~races.models.Redrive`; until all have ended the board
stays, and results with the new engine are held back. The switch is one transaction: new evaluations, standings, fastest
times and a :class:`~races.models.Retiming` for each changed score. A run that fails by the car's fault is void and
refunded; one that fails by ours is queued again. A draw is undone, because later heats depend on earlier ones.

:func:`drive_again` stores no progress: it inspects the rows under the locks and does what is due, at any time and
concurrently. Nothing is done while a live worker has another engine than the caller: both would undo each other's
reruns. Locks: those of higher rooms, entries by id, race; evaluations are stopped after the commit.
"""

import logging
from collections.abc import Sequence
from datetime import datetime
from typing import TypeAlias

from django.db import transaction
from django.db.models import Exists, F, OuterRef, Q, QuerySet

from core.database.after_commit import after_commit
from core.events import record
from core.jobs.retried import pause_after
from evaluation.models import Evaluation, State
from evaluation.running.queue.order import BACKGROUND
from evaluation.running.queue.services import queue_copies
from evaluation.running.worker_nodes import engines_at_work

from ...boards.ranking import Standing as Worth
from ...boards.ranking import standing_in
from ...boards.selectors.board import ranks_of
from ...events import RACE_RETIMED, of_race, record_board
from ...models import Draw, Duel, Entry, Opponents, Race, Redrive, RedriveState, Retiming, Submission
from ...ranks import LAST, NO_RESULT
from ...rules.validation import hold_above
from ..engines import is_official, is_over, site_engine
from .locks import stop_after_commit
from .standings import record_result, work_out_standings

logger = logging.getLogger(__name__)
ACTIVE = (State.QUEUED, State.RUNNING)
BATCH = 500
Standing: TypeAlias = tuple[int | None, int | None]  # score and place


def sweep_redrives(*, now: datetime) -> int:
    """Continue the reruns of every race that needs some; returns the number queued. A failing race stops no other."""
    races = list(_candidates(now))
    if not races:
        return 0
    if _others_drive(now):
        logger.info("%s races wait until all workers have the engine %s.", len(races), site_engine())
        return 0
    return sum(_drive_again_safely(race, now) for race in races)


@transaction.atomic
def drive_again(*, race: Race, now: datetime) -> int:
    """Queue the missing reruns of one race, and after the last one switch the race. Returns the number queued."""
    hold_above(race)
    entries = list(Entry.objects.filter(race=race).select_for_update(of=("self",)).order_by("pk"))
    race = Race.objects.select_for_update(no_key=True, of=("self",)).get(pk=race.pk)
    if len(entries) != Entry.objects.filter(race=race).count():
        return 0  # a racer entered between the two locks: the next sweep covers them
    site = site_engine()
    stale = list(
        _counted(race)
        .exclude(evaluation__result__engine=site)
        .select_related("evaluation__result", "entry")
        .order_by("number", "pk")
    )
    pending = {one.submission_id: one for one in _pending(race)}
    if not _is_needed(race, bool(stale), now):
        _drop(list(pending.values()), now)
        Race.objects.filter(pk=race.pk).exclude(next_engine="").update(next_engine="")
        return 0
    if race.next_engine != site:
        Race.objects.filter(pk=race.pk).update(next_engine=site)
        race.next_engine = site
    _undo_draw(race, entries, now)
    fresh, done = [], []
    for submission in stale:
        earlier = pending.pop(submission.pk, None)
        if earlier is not None and _is_done(earlier, site):
            done.append((submission, earlier))
        elif earlier is None or _is_of_no_use(earlier, site, now):
            fresh.append((submission, earlier))
    _drop([*pending.values(), *(earlier for _submission, earlier in fresh if earlier is not None)], now)
    if fresh:
        _queue(fresh, site, now)
    elif len(done) == len(stale):
        _switch(race, entries, done, now)
    return len(fresh)


def drive_again_after_commit(evaluation: Evaluation, now: datetime) -> None:
    """Switch the race of a rerun that was its last one, after the commit. If that fails, the sweep does it."""
    redrive = Redrive.objects.filter(evaluation=evaluation, state=RedriveState.PENDING)
    if redrive.exists():  # of few runs, and the query of the race is a long one
        after_commit(_end_safely, Race.objects.filter(entries__submissions__redrives__in=redrive).earliest("pk"), now)


def _candidates(now: datetime) -> QuerySet[Race]:
    """Races that may need something: those under way, and those that another engine drove and that are not over."""
    active = Evaluation.objects.filter(state__in=ACTIVE, submission__entry__race=OuterRef("pk"))
    undecided = Q(opponents=Opponents.MODELS) & (Q(draw=None) | Q(draw__over_at=None))
    not_over = Q(closes_at__gt=now) | undecided | Exists(active)
    other = ~Q(engine__in=("", site_engine())) & Q(cancelled_at=None, imported_at=None) & not_over
    return Race.objects.filter(~Q(next_engine="") | other).order_by("closes_at", "pk")


def _is_needed(race: Race, has_stale: bool, now: datetime) -> bool:
    if race.cancelled_at is not None or race.imported_at is not None or not race.engine or is_official(race):
        return False  # whatever is under way
    if race.engine == site_engine() and not has_stale:
        return False
    return bool(race.next_engine) or not is_over(race, now)


def _counted(race: Race) -> QuerySet[Submission]:
    return Submission.objects.filter(entry__race=race, is_void=False, evaluation__result__isnull=False)


def _pending(race: Race) -> QuerySet[Redrive]:
    redrives = Redrive.objects.filter(submission__entry__race=race, state=RedriveState.PENDING)
    return redrives.select_related("evaluation__result")


def _is_done(redrive: Redrive, site: str) -> bool:
    """Whether it ended with the site's engine: with a result, or with the verdict that there is none."""
    run = redrive.evaluation
    if redrive.engine != site or not run.is_final or run.is_platform_fault:
        return False
    return run.state != State.FINISHED or run.result.engine == site


def _is_of_no_use(redrive: Redrive, site: str, now: datetime) -> bool:
    """Whether another run is due in its place: of another engine, or failed by our fault with its pause over."""
    run = redrive.evaluation
    if run.is_platform_fault and redrive.engine == site:
        assert run.ended_at is not None, "failed"
        return run.ended_at + pause_after(redrive.tries + 1) <= now  # it was tried before
    return redrive.engine != site or run.is_final


def _drop(redrives: Sequence[Redrive], now: datetime) -> None:
    Redrive.objects.filter(pk__in=[one.pk for one in redrives]).update(state=RedriveState.DROPPED)
    stop_after_commit(Evaluation.objects.filter(redrive__in=redrives), now=now)


def _queue(wanted: Sequence[tuple[Submission, Redrive | None]], site: str, now: datetime) -> None:
    copies = queue_copies(
        evaluations=[submission.evaluation for submission, _earlier in wanted], priority=BACKGROUND, now=now
    )
    Redrive.objects.bulk_create(
        [
            Redrive(
                submission=submission,
                evaluation=copy,
                engine=site,
                tries=1 + (earlier.tries if earlier is not None and earlier.evaluation.is_platform_fault else 0),
            )
            for (submission, earlier), copy in zip(wanted, copies, strict=True)
        ],
        batch_size=BATCH,
    )


def _undo_draw(race: Race, entries: Sequence[Entry], now: datetime) -> None:
    """Back to qualifying, with the results that stood when the duels were drawn."""
    if not Draw.objects.filter(race=race).exists():
        return
    stop_after_commit(Evaluation.objects.filter(duel__race=race), now=now)
    Duel.objects.filter(race=race).delete()
    Draw.objects.filter(race=race).delete()
    drawn = [entry for entry in entries if entry.seed is not None]
    for entry in drawn:
        entry.seed, entry.points, entry.duels, entry.duel_lap_ms = None, 0, 0, None
        entry.classified, entry.score_ms, entry.rank_score, entry.rank_lap = False, None, NO_RESULT, LAST
    names = ["seed", "points", "duels", "duel_lap_ms", "classified", "score_ms", "rank_score", "rank_lap"]
    Entry.objects.bulk_update(drawn, names, batch_size=BATCH)
    work_out_standings(race, drawn)
    record_board(race)
    logger.warning("The draw of %s is undone: its runs are driven again with %s.", race.slug, race.next_engine)


def _switch(race: Race, entries: Sequence[Entry], done: Sequence[tuple[Submission, Redrive]], now: datetime) -> None:
    """Make all reruns of a race count at once."""
    old_engine, before = race.engine, _standings(entries)
    counted_by = {entry.pk: entry.best_id for entry in entries}
    for submission, redrive in done:
        old, new = submission.evaluation_id, redrive.evaluation
        Submission.objects.filter(pk=submission.pk).update(evaluation=new)
        Redrive.objects.filter(pk=redrive.pk).update(state=RedriveState.TAKEN, replaced=old)
        if new.state != State.FINISHED:
            Submission.objects.filter(pk=submission.pk).update(is_void=True, refunded=True)
            Entry.objects.filter(pk=submission.entry_id).update(submission_count=F("submission_count") - 1)
    race.engine, race.next_engine = race.next_engine, ""
    Race.objects.filter(pk=race.pk).update(engine=race.engine, next_engine="")
    for entry in entries:
        entry.race = race
    work_out_standings(race, entries)
    if old_engine != race.engine:
        _note_retimings(race, old_engine, before, _standings(entries), counted_by, done, now)
    _note_results(race, old_engine, done, now)  # after it: a change of the lead by the switch is no overtaking
    record_board(race)
    logger.info("%s counts by %s now: %s runs were driven again.", race.slug, race.engine, len(done))


def _note_results(race: Race, old_engine: str, done: Sequence[tuple[Submission, Redrive]], now: datetime) -> None:
    """Record results that count now and did not before."""
    for submission, redrive in done:
        if submission.evaluation.result.engine != old_engine:
            record_result(submission, redrive.evaluation, at=now)
    if old_engine != race.engine:
        again = [submission.pk for submission, _redrive in done]
        held_back = _counted(race).filter(evaluation__result__engine=race.engine).exclude(pk__in=again)
        for submission in held_back.select_related("entry", "evaluation").order_by("pk"):
            record_result(submission, submission.evaluation, at=now)


def _note_retimings(
    race: Race,
    old_engine: str,
    before: dict[int, Standing],
    after: dict[int, Standing],
    counted_by: dict[int, int | None],
    done: Sequence[tuple[Submission, Redrive]],
    now: datetime,
) -> None:
    """Record entries with another score under the new engine."""
    scores: dict[int, Worth] = {}
    verdicts = {submission.pk: redrive.evaluation for submission, redrive in done}
    for submission, redrive in done:
        if redrive.evaluation.state == State.FINISHED:
            worth = standing_in(race, redrive.evaluation.result.laps)
            best = scores.get(submission.entry_id)
            scores[submission.entry_id] = worth if best is None or worth.key < best.key else best
    changes = []
    for entry in {submission.entry_id for submission, _redrive in done}:
        (old_score, old_rank), (score_now, new_rank) = before[entry], after[entry]
        new_score = scores[entry].score_ms if entry in scores else None
        if old_score == new_score:
            continue
        counted = counted_by[entry]
        run = None if counted is None else verdicts.get(counted)
        failed = None if run is None or run.state == State.FINISHED else run
        changes.append(
            Retiming(
                entry_id=entry,
                at=now,
                old_engine=old_engine,
                new_engine=race.engine,
                old_score_ms=old_score,
                new_score_ms=new_score,
                old_rank=old_rank,
                new_rank=new_rank if new_score == score_now else None,
                reason_code="" if failed is None else failed.reason_code,
                reason_params={} if failed is None else failed.reason_params,
            )
        )
    Retiming.objects.bulk_create(changes, batch_size=BATCH)
    if changes:
        record(RACE_RETIMED, at=now, **of_race(race), engine=race.engine)


def _standings(entries: Sequence[Entry]) -> dict[int, Standing]:
    ranks: dict[int, int | None] = {}
    for begin in range(0, len(entries), BATCH):
        ranks |= ranks_of(entries[begin : begin + BATCH])
    return {entry.pk: (entry.score_ms, ranks[entry.pk]) for entry in entries}


def _others_drive(now: datetime) -> bool:
    return bool(engines_at_work(now=now) - {site_engine()})


def _end_safely(race: Race, now: datetime) -> None:
    if not _pending(race).filter(evaluation__state__in=ACTIVE).exists() and not _others_drive(now):
        _drive_again_safely(race, now)


def _drive_again_safely(race: Race, now: datetime) -> int:
    try:
        return drive_again(race=race, now=now)
    except Exception:  # the old board stands; the next sweep tries again
        logger.exception("The runs of %s cannot be driven again.", race.slug)
        return 0
