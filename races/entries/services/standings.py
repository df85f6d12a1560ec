"""Standings: the changes of an ended evaluation to its entry, in the transaction that ends it.

A standing is the least of a total order, fastest times are minima: neither the order of results nor a repeated one
changes anything.
"""

from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime

from django.db import transaction
from django.db.models import F, Min, Q, Value
from django.db.models.functions import Coalesce, Least

from core.database.columns import default_of
from core.database.kept_queries import KeptQuery
from core.events import record
from evaluation.models import Evaluation, Result, State

from ...boards.counted_laps import counted_laps, sessions_that_count
from ...boards.ranking import Standing, best_of_sectors, standing_in
from ...events import RACE_RESULT, record_board
from ...models import Entry, Race, Submission
from ...ranks import LAST, NO_RESULT
from ...rules.live_start import begins_elsewhere
from ..engines import admit
from ..hooks import recount_drawn
from .locks import lock_entries, lock_entry

FASTEST = {
    "fastest_lap_ms": "own_lap_ms",
    "fastest_sector_1_ms": "own_sector_1_ms",
    "fastest_sector_2_ms": "own_sector_2_ms",
    "fastest_sector_3_ms": "own_sector_3_ms",
}
# Columns of an entry that are copied from a standing.
_COPIED = (
    "classified",
    "score_ms",
    "average_ms",
    "best_lap_ms",
    "total_ms",
    "complete_laps",
    "off_tracks",
    "crashes",
    "resets",
    "rank_score",
    "rank_lap",
)
_STANDING_FIELDS = ("best", "best_session", *_COPIED, "sectors", "achieved_at", "is_live", *FASTEST.values(), "car_of")


_submissions: KeptQuery[Submission] = KeptQuery(lambda evaluation: Submission.objects.filter(evaluation_id=evaluation))


@transaction.atomic
def record_ended_evaluation(*, evaluation: Evaluation, result: Result | None, now: datetime) -> Entry | None:
    """Apply an evaluation that has just ended to its race; None without a race.

    A run without a verdict on the car (Paddock failed, or its owner stopped it) is void; the submission is refunded
    unless its owner stopped a car on track. A result of another engine is held back (races.entries.services.redrives).
    """
    found = _submissions(evaluation=evaluation.pk)
    if not found:
        return None
    submission = found[0]
    # with its race, whose runs may have been rerun with another engine since
    submission.entry = entry = lock_entry(submission.entry_id)
    if result is not None:
        _take_result(entry, submission, result)
        if result.engine == entry.race.engine:
            record_result(submission, evaluation, at=now)
    elif evaluation.state == State.STOPPED or evaluation.is_platform_fault:
        _void(entry, submission, refund=evaluation.is_platform_fault or evaluation.started_at is None)
    return entry


def record_result(submission: Submission, evaluation: Evaluation, *, at: datetime) -> None:
    """Record that a car's result counts in its race: once for each result, for any reason to count."""
    entry = submission.entry
    run = {"subject": evaluation.public_id, "once": evaluation.public_id}
    record(RACE_RESULT, at=at, racer=entry.racer_id, race=entry.race_id, submission=submission.pk, **run)


def work_out_standings(race: Race, entries: Iterable[Entry]) -> None:
    """Recompute these undrawn entries of a race, locked with it by the caller, from submissions or sessions."""
    for entry in entries:
        _clear(entry)
        if race.physical:
            _take_best_session(race, entry)
            entry.save(update_fields=_STANDING_FIELDS)
            continue
        submissions = entry.submissions.filter(is_void=False, car_of=None, evaluation__result__engine=race.engine)
        for submission in submissions.select_related("evaluation__result").order_by("pk"):
            _improve(entry, submission, _standing(race, submission, submission.evaluation.result))
        if entry.best_id is None:
            entry.car_of_id = _car_holder(entry)
        entry.save(update_fields=_STANDING_FIELDS)
    recompute_fastest(race=race)


@transaction.atomic
def recompute_race(*, race: Race) -> int:
    """Recompute all entries of a race, drawn ones from their duels; returns their number."""
    entries = lock_entries(race.entries.values_list("pk", flat=True))
    race = entries[0].race if entries else race
    if drawn := [entry for entry in entries if entry.seed is not None]:
        recount_drawn(race, drawn)
    if race.imported_at is None:
        work_out_standings(race, [entry for entry in entries if entry.seed is None])
    else:  # recorded, not driven here: there is nothing to work it out from
        recompute_fastest(race=race)
    record_board(race)
    return len(entries)


def note_fastest(entry: Entry) -> None:
    """Lower the race's fastest times to those of a ranked entry."""
    if entry.is_baseline or entry.is_withdrawn or not entry.classified:
        return
    own = {name: getattr(entry, column) for name, column in FASTEST.items() if getattr(entry, column) is not None}
    slower = Q()
    for name, time_ms in own.items():
        slower |= Q(**{f"{name}__isnull": True}) | Q(**{f"{name}__gt": time_ms})
    if own:
        Race.objects.filter(slower, pk=entry.race_id).update(
            **{name: Least(Coalesce(F(name), Value(time_ms)), Value(time_ms)) for name, time_ms in own.items()}
        )


def forget_fastest(entry: Entry) -> None:
    """Recompute the race's fastest times if the entry, which has just left the board, held one of them."""
    race = Race.objects.only(*FASTEST).get(pk=entry.race_id)
    fastest = {name: getattr(race, name) for name in FASTEST}
    if any(time is not None and time == getattr(entry, FASTEST[name]) for name, time in fastest.items()):
        recompute_fastest(race=race)


@transaction.atomic
def recompute_fastest(*, race: Race) -> None:
    """Work out a race's fastest times from everybody with a rank on its board."""
    Race.objects.select_for_update(no_key=True).only("pk").get(pk=race.pk)
    ranked = Entry.objects.filter(race=race, is_baseline=False, withdrawn_at=None, classified=True)
    fastest = ranked.aggregate(**{f"least_{name}": Min(column) for name, column in FASTEST.items()})
    Race.objects.filter(pk=race.pk).update(**{name: fastest[f"least_{name}"] for name in FASTEST})


def _standing(race: Race, submission: Submission, result: Result) -> Standing:
    standing = standing_in(race, result.laps, is_live=submission.is_live)
    if submission.is_live and begins_elsewhere(submission.evaluation):
        return replace(standing, sectors=(), best_sectors=())  # they are other parts of the track
    return standing


def _take_result(entry: Entry, submission: Submission, result: Result) -> None:
    if submission.is_void or submission.car_of_id or entry.seed is not None or not admit(entry.race, result.engine):
        return
    _improve(entry, submission, _standing(entry.race, submission, result))
    entry.save(update_fields=_STANDING_FIELDS)
    note_fastest(entry)


def _car_holder(entry: Entry) -> int | None:
    """The earlier sender of an entry's car, for an entry without a best run."""
    others = entry.submissions.filter(is_void=False, car_of__isnull=False)
    return others.order_by("pk").values_list("car_of", flat=True).first()


def _void(entry: Entry, submission: Submission, *, refund: bool) -> None:
    voided = Submission.objects.filter(pk=submission.pk, is_void=False).update(is_void=True, refunded=refund)
    if voided and refund:
        Entry.objects.filter(pk=entry.pk).update(submission_count=F("submission_count") - 1)
        entry.refresh_from_db(fields=["submission_count"])


def _clear(entry: Entry) -> None:
    for name in _STANDING_FIELDS:
        setattr(entry, name, default_of(Entry, name))
    entry.rank_score, entry.rank_lap = NO_RESULT, LAST


def _improve(entry: Entry, submission: Submission, standing: Standing) -> None:
    """Take over ``standing`` if it beats the entry's, and the fastest times in any case."""
    _note_own_fastest(entry, standing)
    held = (entry.rank_score, entry.rank_lap, entry.resets, entry.achieved_at, entry.best_id)
    if entry.best_id is not None and held <= (*standing.key, submission.submitted_at, submission.pk):
        return
    entry.best, entry.car_of = submission, None
    _stand(entry, standing, submission.submitted_at)


def _take_best_session(race: Race, entry: Entry) -> None:
    """Of real cars the best session counts, of equals the earlier; no order of arrival changes that."""
    best: tuple | None = None
    for session in sessions_that_count(entry):
        standing = standing_in(race, counted_laps(race, session.laps.all()))
        _note_own_fastest(entry, standing)
        place = (*standing.key, session.started_at, session.number)
        if best is None or place < best:
            best, entry.best_session = place, session
            _stand(entry, standing, session.started_at)


def _stand(entry: Entry, standing: Standing, at: datetime) -> None:
    for name in _COPIED:
        setattr(entry, name, getattr(standing, name))
    entry.sectors, entry.achieved_at = list(standing.sectors), at
    entry.is_live = standing.is_live and standing.classified


def _note_own_fastest(entry: Entry, standing: Standing) -> None:
    """The fastest of the racer's classified runs, and of all of them as long as none is classified."""
    if entry.classified and not standing.classified:
        return
    if standing.classified and not entry.classified:
        entry.own_lap_ms = entry.own_sector_1_ms = entry.own_sector_2_ms = entry.own_sector_3_ms = None
    if standing.best_lap_ms is not None:
        entry.own_lap_ms = min(entry.own_lap_ms or LAST, standing.best_lap_ms)
    own = tuple(time for time in entry.own_sectors_ms if time is not None)
    sectors = best_of_sectors((own, standing.best_sectors))
    if sectors:
        entry.own_sector_1_ms, entry.own_sector_2_ms, entry.own_sector_3_ms = sectors
