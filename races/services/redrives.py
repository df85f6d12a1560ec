"""A race has one engine: what happens when the site's is another one.

Lap times of two engines say nothing about each other, so no board ever ranks them together. ``Race.engine`` is the
engine of the results that count in a race; the first of them names it. When the site drives with another one:

- **A race that is over keeps its engine for ever.** Over is a race that was cancelled or recorded elsewhere, one
  whose round is official, and one that has closed and waits for nothing: its board is what everybody has seen since.
- **Every other race is driven again.** Each counted run is queued once more, exactly as it was frozen (model, track,
  rules), as a :class:`~races.models.Redrive`: at the lowest priority there is, so nobody waits for it; no submission,
  of no quota, and seen by operators alone. Also runs of who has withdrawn, who may come back. The engine need not be
  newer: a site that went back to an old one drives its open races again too, for its new results are of that one.
- **Until all of them have ended the board stands as it was.** Cars sent meanwhile drive with the new engine. Their
  runs can be watched and looked at, but do not count yet: they are held back until the switch, which is as far away
  as the queue is long. Showing them on the board beside times of another engine would be the very thing that is
  promised not to happen. "The result is in" is told when they count.
- **The switch is one transaction**: each submission has its new evaluation, all standings and fastest times are
  worked out anew (what was held back counts from here on), the race has the new engine. For each entry whose score is
  another one a :class:`~races.models.Retiming` is written, which the league's notices tell from.
- **A run that fails by the car's fault** under the new engine is that engine's verdict on it, as it would be for
  anybody who sent it today: it has no time. It was not its racer's idea to drive again, so the submission is void and
  given back.
- **A run that fails by ours** waits in the queue and is tried again like any (:mod:`core.jobs.retried`). One
  that was given up is queued again, after the same pauses, from the second on: a car's place is not lost to our
  fault, and the old board stands. An operator who sees that it will never do (a file is gone for good) stops that run:
  then it counts like one that failed by the car's fault, and the race goes on.
- **A race that closes meanwhile** is switched all the same, and becomes official only afterwards: cars that were sent
  in time with the new engine would otherwise count nowhere. A car that was queued when its race closed, and is driven
  by another engine, makes the race one to be driven again for the same reason.
- **Duels** are over when the last heat is. A draw waits for the switch. One whose heats were under way is undone: its
  seeds and decided heats are of the old engine, in a bracket everything hangs on who won before, so the race goes
  back to its qualifying, is driven again, and drawn anew. A heat that another engine than the race's has driven never
  counts.
- **A second change of the engine** during the first drops what the first one queued or drove, and begins anew.

Nothing here remembers where it was: :func:`drive_again` looks at what there is under the locks, does what is due, and
may be called as often as wanted, by as many as want to. The periodic sweep calls it for every race that needs it, and
the end of the last run for its own. While a live worker still drives with another engine than the caller's (machines
are upgraded one after the other), nothing is done: they would drive for each
other in vain.

Locks: those of the rooms above, entries by their id, race; evaluations are stopped after the commit.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from typing import TypeAlias

from django.db import transaction
from django.db.models import Exists, F, OuterRef, Q, QuerySet

from core.events import record
from core.jobs.retried import pause_after
from evaluation.models import Evaluation, State
from evaluation.queue_order import BACKGROUND
from evaluation.services import engines_at_work, queue_copies

from ..engines import is_official, is_over, site_engine
from ..events import RACE_RETIMED, of_race, record_board
from ..models import (
    Draw,
    Duel,
    Entry,
    Opponents,
    Race,
    Redrive,
    RedriveState,
    Retiming,
    Submission,
)
from ..ranking import LAST, NO_RESULT, standing_in
from ..ranking import Standing as Worth
from ..selectors.boards import ranks_of
from ..validation import hold_above
from .standings import record_result, work_out_standings
from .stopping import stop_evaluations_after_commit

logger = logging.getLogger(__name__)
ACTIVE = (State.QUEUED, State.RUNNING)
BATCH = 500
Standing: TypeAlias = tuple[int | None, int | None]  # score and place


def sweep_redrives(*, now: datetime) -> int:
    """Do what is due for every race whose counted runs are not of this site's engine. Returns how many runs were
    queued. One race that fails does not keep the others waiting."""
    races = list(_candidates(now))
    if not races:
        return 0
    if _others_drive(now):
        logger.info("%s races wait until all workers have the engine %s.", len(races), site_engine())
        return 0
    return sum(_drive_again_safely(race, now) for race in races)


@transaction.atomic
def drive_again(*, race: Race, now: datetime) -> int:
    """Do what is due for one race (see this module): queue what must be driven again, and once all of it has been, let
    it count. Returns how many runs were queued; 0 also when there is nothing to do."""
    hold_above(race)
    entries = list(Entry.objects.filter(race=race).select_for_update(of=("self",)).order_by("pk"))
    race = Race.objects.select_for_update(no_key=True, of=("self",)).get(pk=race.pk)
    if len(entries) != Entry.objects.filter(race=race).count():
        return 0  # somebody has entered between the two locks: the next sweep sees them
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
    """When a run that was driven again has ended, and it was its race's last: the switch, once the present transaction
    is through. If that fails, the sweep does it."""
    redrive = Redrive.objects.filter(evaluation=evaluation, state=RedriveState.PENDING)
    race = Race.objects.filter(entries__submissions__redrives__in=redrive).first()
    if race is not None:
        transaction.on_commit(partial(_end_safely, race, now), robust=True)


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
    """Whether it says what the site's engine makes of the car: a result, or a verdict that there is none."""
    run = redrive.evaluation
    if redrive.engine != site or not run.is_final or run.is_platform_fault:
        return False
    return run.state != State.FINISHED or run.result.engine == site


def _is_of_no_use(redrive: Redrive, site: str, now: datetime) -> bool:
    """Whether another run has to be queued in its place: it is for an engine of the past or came out of one, or we have
    failed and the pause is over."""
    run = redrive.evaluation
    if run.is_platform_fault and redrive.engine == site:
        assert run.ended_at is not None, "failed"
        return run.ended_at + pause_after(redrive.tries + 1) <= now  # it was tried before
    return redrive.engine != site or run.is_final


def _drop(redrives: Sequence[Redrive], now: datetime) -> None:
    ids = [one.pk for one in redrives]
    Redrive.objects.filter(pk__in=ids).update(state=RedriveState.DROPPED)
    stop_evaluations_after_commit(Evaluation.objects.filter(redrive__in=ids), now=now)


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
    stop_evaluations_after_commit(Evaluation.objects.filter(duel__race=race), now=now)
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
    """Let what was driven again count, all of it at once."""
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
    _note_results(race, old_engine, done, now)  # after it: whoever leads since was not driven past
    record_board(race)
    logger.info("%s counts by %s now: %s runs were driven again.", race.slug, race.engine, len(done))


def _note_results(race: Race, old_engine: str, done: Sequence[tuple[Submission, Redrive]], now: datetime) -> None:
    """What was held back counts now and is told like any result, also by what was driven again in its place. A car
    whose result counted before is no news."""
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
    """Write down whose cars have another score with the new engine. What a car sent meanwhile is worth is a result like
    any, and none of this: an entry that ranks by such a one has a new time here and no new place."""
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
    """Score and place of each entry."""
    ranks: dict[int, int | None] = {}
    for begin in range(0, len(entries), BATCH):
        ranks |= ranks_of(entries[begin : begin + BATCH])
    return {entry.pk: (entry.score_ms, ranks[entry.pk]) for entry in entries}


def _others_drive(now: datetime) -> bool:
    """Whether a live worker has another engine than this process."""
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
