"""Stores the trained models in the garage and submits them to a race."""

import io
import json
import logging
import uuid
from collections.abc import Callable
from datetime import datetime
from functools import partial
from typing import Literal

from django.db import transaction

from accounts.models import Racer
from core.files.storage_faults import storage_at_work
from core.jobs.retried import detail_with
from evaluation.appearance.looks import VehicleLook
from evaluation.garage.services import upload_model
from evaluation.models import Evaluation, TrainedModel
from evaluation.selectors import can_use_model
from evaluation.stored_files import store
from paddock.errors import PaddockError, UserFault
from paddock.packages.read import UploadPart
from races.entries.services.submissions import submit_model
from races.models import OwnEvaluation, Submission
from races.test_runs.services import drive_own

from ...events import record_end
from ...models import EndReason, JobState, SweepTrial, TrainingJob
from ...models.sweep import RungResult
from ...trainer.client import Ended
from .deletion import delete_stored, drop_checkpoints
from .layout import options_of_a_test
from .queue import TRAININGS
from .records import append_log
from .usage_accounting import charge

logger = logging.getLogger(__name__)
_NAMES_TRIED = 50
_NAME_LIMIT = 64


def admit_networks(*, job: TrainingJob, best: bytes, last: bytes, now: datetime) -> tuple[TrainedModel, TrainedModel]:
    """Admit both networks like uploads, as models of the owner; a full garage takes them, too.

    The best takes the training's name, the last that name with ``-last``. Equal networks are one model; if the gate
    refuses one of them (a reward function can reach into the trainer), the other is both. Raises as
    :func:`evaluation.garage.services.upload_model` if it refuses both.
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
    """Store the stable-baselines3 file; its name, or "". Raises PlatformFault("storage_failed")."""
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
    models: tuple[TrainedModel, TrainedModel] | None,
    sb3_zip: str = "",
    fault: PaddockError | None = None,
    detail: str = "",
    now: datetime,
) -> bool:
    """Write the end of a training that leaves models, and submit and drive the best as chosen, in one transaction.
    False: the lease is gone.

    ``models=None``: a trial of a sweep that keeps its checkpoints. ``fault`` (and no ``ended``): what ended it early.
    ``sb3_zip``: of :func:`keep_sb3`. ``detail``: for operators.
    """
    best, last = models or (None, None)
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
            if job.stop_seconds is not None and ended is not None:
                record_rung(job, ended)
            if best is None:
                return True
            drop_checkpoints(job)
            if fault is None and job.submit_to_race_id is not None:
                _follow_up(job, "submit", "submission", partial(_submit, job, best, now), failed="submit_failed")
            if fault is None and job.evaluate_on_id is not None:
                drive = partial(_drive, job, best, now)
                _follow_up(job, "evaluate", "own_evaluation", drive, failed="evaluate_failed")
    if not finished:
        delete_stored([sb3_zip])
    return finished


def record_rung(job: TrainingJob, ended: Ended) -> None:
    """Add the best evaluation of a trial to its results, if its rung is over."""
    if ended.why != EndReason.TIME:
        return
    trial = SweepTrial.objects.select_for_update(no_key=True).get(job=job)
    best = job.iterations.filter(is_best=True).only("eval_progress", "eval_lap_ms").first()
    progress, lap_ms = (best.eval_progress, best.eval_lap_ms) if best is not None else (0.0, None)
    result: RungResult = {"seconds": ended.seconds, "progress": progress, "lap_ms": lap_ms}
    trial.results.append(result)
    trial.save(update_fields=["results"])


def _follow_up(job: TrainingJob, kind: str, column: str, act: Callable[[], object], *, failed: str) -> None:
    """Store the row that ``act`` returns, or the reason of its failure in the columns of ``kind``, within the
    transaction that ends the training: the model stays in any case. ``failed``: the code of a fault of the platform."""
    rows = TrainingJob.objects.filter(pk=job.pk)
    try:
        with transaction.atomic():
            try:
                rows.update(**{column: act()})
            except UserFault as fault:  # within the savepoint: what a race notes of a refusal stays
                rows.update(**{f"{kind}_reason_code": fault.code, f"{kind}_reason_params": fault.params})
    except Exception:  # a fault of ours must not cost the model: the racer sees ``failed``, operators the log
        logger.exception("Training %s: %s failed.", job.public_id, kind)
        rows.update(**{f"{kind}_reason_code": failed, f"{kind}_reason_params": {}})


def _submit(job: TrainingJob, model: TrainedModel, now: datetime) -> Submission:
    assert job.submit_to_race is not None  # a race that is deleted by now raises here
    return submit_model(race=job.submit_to_race, racer=job.owner, model=model, now=now)


def _drive(job: TrainingJob, model: TrainedModel, now: datetime) -> OwnEvaluation:
    return drive_own(owner=job.owner, model=model, track=job.evaluate_on, now=now, **options_of_a_test(job))


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


def evaluate_training(
    *, job: TrainingJob, which: Literal["best", "last"] = "best", by: Racer, now: datetime
) -> Evaluation:
    """Queue three laps of the best or the last model on its training's track and layout, as a private test run.

    Raises UserFault ``training_no_model``, ``model_not_yours``, and as :func:`races.test_runs.services.drive_own`.
    """
    model = job.last_model if which == "last" else job.best_model
    if model is None or model.deleted_at is not None:
        raise UserFault("training_no_model")
    if not can_use_model(by, model):
        raise UserFault("model_not_yours")
    own = drive_own(owner=by, model=model, track=job.track, now=now, **options_of_a_test(job))
    assert own.evaluation is not None, "it has just been queued"
    return own.evaluation
