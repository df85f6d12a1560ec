"""From the networks that a training made to models in its owner's garage, and on to a race."""

from __future__ import annotations

import io
import json
import logging
import uuid
from datetime import datetime

from django.db import transaction

from core.jobs.retried import detail_with
from core.storage_faults import storage_at_work
from evaluation.looks import VehicleLook
from evaluation.models import TrainedModel
from evaluation.services import upload_model
from evaluation.services.stored import store
from paddock.errors import PaddockError, UserFault
from paddock.packages.read import UploadPart
from races.services import drive_own, submit_model

from ..events import record_end
from ..models import EndReason, JobState, TrainingJob
from ..trainer.client import Ended
from .evaluate import options_of_a_test
from .jobs import TRAININGS
from .records import append_log, delete_stored, drop_checkpoints
from .tolls import charge

logger = logging.getLogger(__name__)
_NAMES_TRIED = 50
_NAME_LIMIT = 64


def admit_networks(*, job: TrainingJob, best: bytes, last: bytes, now: datetime) -> tuple[TrainedModel, TrainedModel]:
    """Both networks as models of the owner, by the way of every upload: the gate, canonical bytes, the garage's limits.

    The best takes the training's name, the last that name with ``-last``; where both are the same network they are one
    model, and where the gate refuses one of them (a reward function can reach into the trainer) it is the other.
    A full garage takes them too: there was room when the training was taken on. What is in the garage already is not
    added again. Raises what :func:`evaluation.services.upload_model` raises, for the last if it refuses both.
    """
    try:
        model = _admit(job, best, job.name, now)
    except UserFault:
        if last == best:
            raise
        model = _admit(job, last, job.name, now)
        return model, model
    if last == best:
        return model, model
    try:
        return model, _admit(job, last, f"{job.name[: _NAME_LIMIT - 5]}-last", now)
    except UserFault as fault:
        append_log(job_id=job.pk, line=f"the last network is not kept: {fault}", now=now)
        return model, model


def keep_sb3(*, job: TrainingJob, lease: uuid.UUID, ended: Ended) -> str:
    """Store what stable-baselines3 reads; the file's name, ``""`` where there is none.

    Raises PlatformFault("storage_failed").
    """
    if not ended.sb3_zip:
        return ""
    path = f"training/{job.public_id}/{lease.hex[:8]}-sb3.zip"
    with storage_at_work():
        return store(path, ended.sb3_zip)


def finish_training(
    *,
    job: TrainingJob,
    lease: uuid.UUID,
    ended: Ended | None,
    models: tuple[TrainedModel, TrainedModel],
    sb3_zip: str = "",
    fault: PaddockError | None = None,
    detail: str = "",
    now: datetime,
) -> bool:
    """Write how a training ended that leaves models, once, and in the same transaction submit the best to the race and
    drive it on the track that were chosen: a worker that dies in between has done nothing of it, and the next one does
    all. False: the lease is gone.

    ``fault`` (and no ``ended``): what ended it early; what it had learned until then is kept. ``sb3_zip``: of
    :func:`keep_sb3`. ``detail``: what operators read of it.
    """
    best, last = models
    changes: dict = {"state": JobState.FINISHED, "ended_because": ended.why if ended is not None else ""}
    if fault is not None:
        changes = {"state": JobState.FAILED, "ended_because": EndReason.FAILED}
        changes |= {"reason_code": fault.code, "reason_params": fault.params}
        if detail:
            changes["operator_detail"] = detail_with(detail)
    elif ended is not None and ended.why == "stopped":
        changes = {"state": JobState.STOPPED, "ended_because": EndReason.STOPPED}
    if ended is not None:
        changes |= {"steps_done": ended.steps, "seconds_done": ended.seconds, "reward_ms": ended.reward_ms}
    changes["charged_s"] = charge(job, now)
    with transaction.atomic():
        mine = TRAININGS.held(job.pk, lease)
        finished = TRAININGS.end(mine, now=now, best_model=best, last_model=last, sb3_zip=sb3_zip, seen={}, **changes)
        if finished:
            record_end(job.pk, now)
            drop_checkpoints(job)
            if fault is None and job.submit_to_race_id is not None:
                _submit(job, best, now)
            if fault is None and job.evaluate_on_id is not None:
                _evaluate(job, best, now)
    if not finished:
        delete_stored([sb3_zip])
    return finished


def _submit(job: TrainingJob, model: TrainedModel, now: datetime) -> None:
    """Send the model to its race, within the transaction that ends the training; where it is refused, the reason stands
    with the training."""
    try:
        with transaction.atomic():
            assert job.submit_to_race is not None, "the caller has looked"
            try:
                submission = submit_model(race=job.submit_to_race, racer=job.owner, model=model, now=now)
            except UserFault as fault:  # within the savepoint: what the race notes of a refusal stays
                reason = {"submit_reason_code": fault.code, "submit_reason_params": fault.params}
                TrainingJob.objects.filter(pk=job.pk).update(**reason)
            else:
                TrainingJob.objects.filter(pk=job.pk).update(submission=submission)
    except Exception:  # the model is there all the same: its owner reads that we failed, and can send it by hand
        logger.exception("The model of training %s cannot be submitted.", job.public_id)
        TrainingJob.objects.filter(pk=job.pk).update(submit_reason_code="submit_failed", submit_reason_params={})


def _evaluate(job: TrainingJob, model: TrainedModel, now: datetime) -> None:
    """Drive the model for its owner on the track that was chosen, within the transaction that ends the training; where
    it is refused, the reason stands with the training."""
    try:
        with transaction.atomic():
            options = options_of_a_test(job)
            own = drive_own(owner=job.owner, model=model, track=job.evaluate_on, now=now, **options)
            TrainingJob.objects.filter(pk=job.pk).update(own_evaluation=own)
    except UserFault as fault:
        reason = {"evaluate_reason_code": fault.code, "evaluate_reason_params": fault.params}
        TrainingJob.objects.filter(pk=job.pk).update(**reason)
    except Exception:  # the model is there all the same, for its owner to drive
        logger.exception("The model of training %s cannot be driven.", job.public_id)
        TrainingJob.objects.filter(pk=job.pk).update(evaluate_reason_code="evaluate_failed", evaluate_reason_params={})


def _admit(job: TrainingJob, onnx: bytes, name: str, now: datetime) -> TrainedModel:
    metadata = json.dumps(job.metadata).encode()
    for number in range(1, _NAMES_TRIED):
        ending = f"-{number}" if number > 1 else ""
        parts = [
            UploadPart("model.onnx", io.BytesIO(onnx)),
            UploadPart("model_metadata.json", io.BytesIO(metadata)),
        ]
        wanted = name[: _NAME_LIMIT - len(ending)] + ending
        try:
            uploaded = upload_model(
                owner=job.owner,
                files=parts,
                name=wanted,
                description=job.description,
                look=VehicleLook(job.shell, job.colour),
                has_place=True,
                now=now,
            )
        except UserFault as fault:
            if fault.code != "model_name_taken":
                raise
        else:
            return uploaded.model
    raise UserFault("training_name_taken", name=name)
