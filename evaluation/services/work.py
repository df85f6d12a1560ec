"""One turn of a worker: claim an evaluation, run it under a heartbeat, write down how it ended."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from django.conf import settings

from core.clock import database_now
from core.storage_faults import is_of_storage
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.network.bound import Facts

from ..models import Evaluation, Network, TrainedModel
from ..sandbox import probe as probing
from .heart import Heart
from .leases import beat, claim_next_evaluation, fail_evaluation, finish_evaluation, release_evaluation
from .outages import note_storage_fault
from .stored import read

if TYPE_CHECKING:
    from ..crew import Spare
    from ..pipeline import EvaluationOutcome, RaceJob

logger = logging.getLogger(__name__)
PROGRESS_EVERY_S = 1.0


def run_next_evaluation(
    *, worker: str, interrupted: Callable[[], bool] = lambda: False, spare: Spare | None = None
) -> bool:
    """Run the evaluation whose turn it is to its end. False: nothing waits. ``spare``: where processes may wait, ready.

    ``interrupted`` turns true when the worker is told to shut down: the evaluation is then handed back. Call this from
    a thread that outlives the run (a worker's main thread): the sandboxed processes die with the thread that made them.
    """
    evaluation = claim_next_evaluation(worker=worker, now=database_now())
    if evaluation is None:
        return False
    ident: dict[str, Any] = {"evaluation_id": evaluation.pk, "lease": evaluation.lease}
    logger.info("Evaluation %s attempt %s starts.", evaluation, evaluation.attempt)

    def keep_beating(progress: dict[str, Any] | None) -> bool:
        return beat(**ident, progress=progress, now=database_now())

    with Heart(str(evaluation), keep_beating, every_s=PROGRESS_EVERY_S) as heart:
        try:
            outcome = _run(evaluation, heart, interrupted, spare)
            ended = finish_evaluation(**ident, outcome=outcome, now=database_now())
            how = "finished"
        except Exception as error:
            if not heart.lost and interrupted():
                ended = release_evaluation(**ident, now=database_now())
                how = "handed back"
            else:
                # a run that we stopped because the database was away for too long is no fault of its model
                fault, detail = fault_of(PlatformFault("lease_expired") if heart.lost else error)
                see_what_is_out(fault)
                ended = fail_evaluation(**ident, fault=fault, now=database_now(), detail=detail)
                how = f"failed: {fault.code}"
    logger.info("Evaluation %s %s.", evaluation, how if ended else "was stopped or given to somebody else")
    return True


def job_of(evaluation: Evaluation) -> RaceJob:
    """What the pipeline needs, from the specification that was frozen when the evaluation was queued.

    Raises PlatformFault("storage_failed") or ("file_damaged") for a network's file, ("internal_error") when the track
    is not the one that was frozen.
    """
    from paddock.rules.race import RaceRules

    from ..pipeline import RaceJob, RivalCar

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
            RivalCar(_network_of(rival.model), rival.metadata, rival.model.network.facts)
            for rival in evaluation.rivals.select_related("model__network").order_by("number")
        ),
        look=evaluation.spec.get("look", "official"),
        facts=evaluation.model.network.facts,
    )


def _network_of(model: TrainedModel) -> bytes:
    return read(model.network.onnx.name)


def see_what_is_out(fault: PaddockError) -> None:
    """Before a run goes back into the queue: nobody shall claim the next one only to fail like this one."""
    if fault.code == "storage_failed":
        note_storage_fault(now=database_now())
    elif fault.code == "sandbox_failed":
        probing.look_again()  # the turns of this process end where it says that the wall is gone


def _run(
    evaluation: Evaluation, heart: Heart, interrupted: Callable[[], bool], spare: Spare | None
) -> EvaluationOutcome:
    from ..pipeline import evaluate

    job = job_of(evaluation)
    outcome = evaluate(
        job,
        crew=spare.take(job.venue) if spare else None,
        on_progress=heart.tell,
        should_stop=lambda: heart.lost or interrupted(),
        wall_limit_s=settings.EVALUATION_WALL_SECONDS,
    )
    _note_inexact(evaluation, outcome)
    return outcome


def _note_inexact(evaluation: Evaluation, outcome: EvaluationOutcome) -> None:
    """Networks whose bound did not hold go the exact way from now on."""
    if not outcome.inexact:
        return
    models = [evaluation.model, *(rival.model for rival in evaluation.rivals.order_by("number"))]
    for number in outcome.inexact:
        network = models[number].network
        logger.warning("The bound of network %s did not hold; it goes the exact way from now on.", network)
        Network.objects.filter(pk=network.pk).update(
            facts=Facts(bound=None).to_dict() | {"shapes": (network.facts or {}).get("shapes", {})}
        )


def fault_of(error: Exception) -> tuple[PaddockError, str]:
    """The fault to record for whatever was raised, and what operators read about it."""
    if isinstance(error, UserFault):
        return error, "\n".join(getattr(error, "__notes__", ()))
    code = "storage_failed" if is_of_storage(error) else "internal_error"
    fault = error if isinstance(error, PlatformFault) else PlatformFault(code)
    return fault, "".join(traceback.format_exception(error))
