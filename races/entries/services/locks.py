"""The lock order of a race's rows: entries by id, then the race, last its board counts. A change of an entry that may
touch its race takes both locks first; otherwise two such changes deadlock on PostgreSQL."""

from collections.abc import Iterable
from datetime import datetime

from django.db.models import F, QuerySet

from core.database.after_commit import after_commit
from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation, State
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import UserFault

from ...models import Entry, Race
from ...models.entry import MOST_SUBMISSIONS

_entry: KeptQuery[Entry] = KeptQuery(lambda pk: Entry.objects.select_for_update(of=("self",)).filter(pk=pk))
_race: KeptQuery[Race] = KeptQuery(lambda pk: Race.objects.select_for_update(no_key=True).filter(pk=pk))


def lock_entries(numbers: Iterable[int]) -> list[Entry]:
    """These entries by primary key, locked in that order with their races and read fresh; in a transaction."""
    locked = Entry.objects.select_for_update(of=("self",)).filter(pk__in=list(numbers))
    entries = list(locked.order_by("pk"))
    wanted = sorted({entry.race_id for entry in entries})
    # read under their locks: what the entries' query saw of them may be older
    races = {race.pk: race for race in Race.objects.select_for_update(no_key=True).filter(pk__in=wanted).order_by("pk")}
    for entry in entries:
        entry.race = races[entry.race_id]
    return entries


def lock_entry(entry: int) -> Entry:
    """The same for one, by its primary key. Raises Entry.DoesNotExist."""
    found = _entry(pk=entry)
    if not found:
        raise Entry.DoesNotExist
    (found[0].race,) = _race(pk=found[0].race_id)
    return found[0]


def use_up_one(entry: Entry, code: str) -> None:
    """Use up one submission of an entry, or session of a real car: one guarded UPDATE that changes one row or none.
    Raises UserFault(code) when all are used up."""
    limit = entry.race.max_submissions or MOST_SUBMISSIONS
    counted = Entry.objects.filter(pk=entry.pk, submission_count__lt=limit, last_number__lt=MOST_SUBMISSIONS).update(
        submission_count=F("submission_count") + 1, last_number=F("last_number") + 1
    )
    if not counted:
        raise UserFault(code, limit=limit)
    entry.refresh_from_db(fields=["submission_count", "last_number"])


def stop_after_commit(evaluations: QuerySet[Evaluation], *, now: datetime) -> None:
    """Stop those of ``evaluations`` that wait or drive, after the commit: the lock order is evaluation, entry, race."""
    for evaluation in evaluations.filter(state__in=(State.QUEUED, State.RUNNING)):
        after_commit(stop_evaluation, evaluation=evaluation, now=now)
