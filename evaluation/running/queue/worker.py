"""One turn of a worker: claim an evaluation, run it under a heartbeat, write down how it ended."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from django.conf import settings

from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.work import never, run_next
from core.metrics import Counter
from paddock.errors import PlatformFault
from paddock.network.bound import NetworkFacts

from ...models import Evaluation, Network, TrainedModel
from ...stored_files import read
from .jobs import EVALUATIONS, finish_evaluation

if TYPE_CHECKING:
    from ..pipeline import EvaluationOutcome, RaceJob
    from ..process_pool import SparePool

logger = logging.getLogger(__name__)
PARTS = Counter(
    "paddock_run_part_seconds_total",
    "Wall time of finished runs, by part: start (processes, networks), physics, camera, policy and other; network: the"
    " processor time of the networks, a share of policy.",
    ("part",),
)


def run_next_evaluation(
    *, worker: str, interrupted: Callable[[], bool] = never, spare: SparePool | None = None
) -> bool:
    """Run the next evaluation to its end. False: nothing waits. ``spare``: where processes may wait, ready.
    ``interrupted``: the worker shuts down, and the evaluation goes back to the queue.

    Call this from a thread that outlives the run: the sandboxed processes die with the thread that made them.
    """

    def run(evaluation: Evaluation, heartbeat: Heartbeat) -> bool:
        outcome = _run(evaluation, heartbeat, interrupted, spare)
        assert evaluation.lease is not None, "it was claimed"
        return finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=outcome, now=database_now())

    return run_next(EVALUATIONS, run, worker=worker, interrupted=interrupted)


def job_of(evaluation: Evaluation) -> RaceJob:
    """The pipeline's job from the frozen specification. Raises PlatformFault ``storage_failed``, ``file_damaged``, and
    ``internal_error`` when the track has changed."""
    from paddock.rules.race import RaceRules

    from ..pipeline import RaceJob, RivalModel

    rules = RaceRules.from_dict(evaluation.spec["rules"])
    track = evaluation.track.geometry
    if track.fingerprint != evaluation.spec["track"]:
        raise PlatformFault("internal_error")
    return RaceJob(
        track=track.in_direction(rules.direction),
        rules=rules,
        onnx=_network_of(evaluation.model),
        metadata=evaluation.spec["metadata"],
        rivals=tuple(
            RivalModel(_network_of(rival.model), rival.metadata, rival.model.network.facts)
            for rival in evaluation.rivals.select_related("model__network").order_by("number")
        ),
        look=evaluation.spec.get("look", "official"),
        facts=evaluation.model.network.facts,
    )


def _network_of(model: TrainedModel) -> bytes:
    return read(model.network.onnx.name or "")


def _run(
    evaluation: Evaluation, heartbeat: Heartbeat, interrupted: Callable[[], bool], spare: SparePool | None
) -> EvaluationOutcome:
    from ..pipeline import evaluate

    job = job_of(evaluation)
    outcome = evaluate(
        job,
        pool=spare.take(job.venue) if spare else None,
        on_progress=heartbeat.tell,
        should_stop=lambda: heartbeat.lost or interrupted(),
        wall_limit_s=settings.EVALUATION_WALL_SECONDS,
    )
    for part, seconds in outcome.shares.items():
        PARTS.inc(part, by=max(seconds, 0.0))
    _note_inexact(evaluation, outcome)
    return outcome


def _note_inexact(evaluation: Evaluation, outcome: EvaluationOutcome) -> None:
    if not outcome.inexact:
        return
    models = [evaluation.model, *(rival.model for rival in evaluation.rivals.order_by("number"))]
    for number in outcome.inexact:
        note_inexact(models[number].network)


def note_inexact(network: Network) -> None:
    """Have a network whose bound did not hold go the exact way from now on."""
    logger.warning("The bound of network %s did not hold; it goes the exact way from now on.", network)
    Network.objects.filter(pk=network.pk).update(
        facts=NetworkFacts(bound=None).to_dict() | {"shapes": (network.facts or {}).get("shapes", {})}
    )
