"""The last car that a racer sent to a race, for the box that watches it, and the line of their tries."""

from collections.abc import Sequence
from dataclasses import dataclass

from django.http import HttpRequest

from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation, State
from evaluation.running.queue.selectors import expected_wait_s, queue_position
from races.boards.ranking import Standing, standing_in
from races.models import Entry, Race, Submission
from races.spoilers.selectors import spoilers_of

TRIES = 20
_UNUSED = [f"evaluation__result__{name}" for name in ("trajectory", "metrics", "versions", "layout", "order")]


@dataclass(frozen=True)
class LatestRun:
    """A submission, its place in the queue and the seconds until it is done, where these were looked up. ``earlier``:
    the submissions before it, the latest first, where these were."""

    entry: Entry
    submission: Submission
    position: int | None
    wait_s: float | None
    earlier: Sequence[Submission] = ()

    @property
    def tries(self) -> list[int]:
        """The scores of the classified ones among the last submissions, the oldest first."""
        results = [getattr(each.evaluation, "result", None) for each in (*reversed(self.earlier), self.submission)]
        scores = [standing_in(self.entry.race, result.laps).score_ms for result in results if result is not None]
        return [score for score in scores if score is not None]

    @property
    def evaluation(self) -> Evaluation:
        return self.submission.evaluation

    @property
    def standing(self) -> Standing | None:
        """The result of its finished run in the race; None until then."""
        result = getattr(self.evaluation, "result", None)
        return None if result is None else standing_in(self.entry.race, result.laps)

    @property
    def counts(self) -> bool:
        """Whether the racer's place on the board is of this run."""
        return self.entry.best_id == self.submission.pk

    @property
    def is_held(self) -> bool:
        """Whether its result waits for the race to be driven again with its engine."""
        result = getattr(self.evaluation, "result", None)
        return result is not None and result.engine != self.entry.race.engine

    @property
    def mark(self) -> str:
        return live_mark(self.evaluation, self.position)


def live_mark(evaluation: Evaluation, position: int | None) -> str:
    """A short text that changes whenever an evaluation looks different while it waits or drives."""
    if evaluation.state == State.QUEUED:
        return f"{evaluation.public_id}-queued-{position}"
    if evaluation.state == State.RUNNING:
        return f"{evaluation.public_id}-running-{evaluation.progress.get('total_ms', 0)}"
    return f"{evaluation.public_id}-{evaluation.state}"


def _last(count: int) -> KeptQuery[Submission]:
    return KeptQuery(
        lambda entry: (
            Submission.objects.filter(entry_id=entry)
            .select_related("evaluation__model__network", "evaluation__result")
            .defer("evaluation__spec", *_UNUSED)
            .order_by("-number")[:count]
        )
    )


_last_one, _last_ones = _last(1), _last(TRIES)


def latest_run(entry: Entry | None, *, queue: bool = True, tries: bool = False) -> LatestRun | None:
    """The last submission of ``entry``, if there is one. ``queue``: look for its place there while it waits.
    ``tries``: with the submissions before it."""
    if entry is None or not entry.last_number:
        return None
    found = (_last_ones if tries else _last_one)(entry=entry.pk)
    if not found:
        return None
    submission, *earlier = found
    position = queue_position(submission.evaluation) if queue else None
    wait_s = expected_wait_s(submission.evaluation, position) if position else None
    return LatestRun(entry, submission, position, wait_s, earlier)


def race_page_part(request: HttpRequest, race: Race, entry: Entry | None) -> dict[str, object]:
    """The last run of the reader in the race, unless its results are hidden."""
    return {"latest": None if spoilers_of(request).hides(race) else latest_run(entry, queue=False, tries=True)}
