"""One turn of a trainer: claim a training, run it under a heartbeat, store its result."""

import base64
import io
import logging
import uuid
from collections.abc import Callable
from time import sleep
from typing import cast

from PIL import Image

from core.database.clock import database_now
from core.jobs.outages import note_fault
from core.jobs.work import fault_of, never, run_next
from evaluation.models import TrainedModel
from evaluation.stored_files import read
from paddock.errors import PaddockError, PlatformFault
from paddock.packages.metadata import MetadataDocument
from paddock.rules.training import randomisation

from ...cloning.selectors import build_of_model
from ...models import Checkpoint, SightDocument, TrainingJob
from ...trainer.client import CHECKPOINT, WEIGHTS, Ended, Iteration, Listener, SavedState, train
from ...trainer.messages import SIGHT_COLUMNS, SIGHT_ROWS, Prints, Sight
from ...trainer.network import OURS
from ...trainer.spec import TrainerSpec
from .deletion import delete_stored
from .layout import layout_of
from .queue import TRAININGS, TrainingHeartbeat, verdict
from .records import append_log, keep_checkpoint, networks_of, record_iteration, record_prints
from .results import admit_networks, finish_training, keep_sb3
from .usage_accounting import final_fault

logger = logging.getLogger(__name__)
_ADMISSIONS_TRIED, _ADMISSION_WAIT_S = 5, 5.0


def run_next_training(*, worker: str, interrupted: Callable[[], bool] = never) -> bool:
    """Run the next training in the queue to its end. False: the queue is empty.

    ``interrupted`` turns true when the worker shuts down: another worker resumes the training from its checkpoint.
    """
    return run_next(
        TRAININGS,
        lambda job, heartbeat: _Turn(job, cast("TrainingHeartbeat", heartbeat), interrupted).take(),
        worker=worker,
        interrupted=interrupted,
    )


def spec_of(job: TrainingJob, checkpoint: Checkpoint | None = None) -> TrainerSpec:
    """The trainer's input for a job that resumes from ``checkpoint`` or begins."""
    return TrainerSpec(
        track=job.track.geometry.in_direction(job.direction).to_dict(),
        race_type=job.race_type,
        layout=layout_of(job),
        metadata=cast(MetadataDocument, job.metadata),
        algorithm=job.algorithm,
        hyperparameters=job.hyperparameters,
        reward_code=job.reward_code,
        stop_seconds=job.limit_s,
        stop_steps=job.stop_steps,
        stop_clean_laps=job.stop_clean_laps,
        trials=job.trials,
        best_metric=job.best_metric,
        seed=job.seed,
        seconds_before=checkpoint.seconds if checkpoint is not None else 0.0,
        iterations_before=checkpoint.iteration if checkpoint is not None else 0,
        look=job.track.look,
        more_tracks=[
            {"track": track.geometry.in_direction(job.direction).to_dict(), "look": track.look}
            for track in job.tracks[1:]
        ],
        alternate_direction=job.alternate_direction,
        randomise=randomisation(job.randomised),
        continues=not job.keeps_models,
        build=OURS if job.cloned_from is None else build_of_model(job.cloned_from) or OURS,
    )


class _Turn(Listener):
    def __init__(self, job: TrainingJob, heartbeat: TrainingHeartbeat, interrupted: Callable[[], bool]) -> None:
        self._job, self._heartbeat, self._interrupted = job, heartbeat, interrupted
        assert job.lease is not None, "it was claimed"
        self._lease: uuid.UUID = job.lease
        self._best = self._last = b""

    def take(self) -> bool:
        try:
            final = verdict(self._job)
            return self._run() if final is None else self._keep_models(final)
        except Exception as error:
            if not self._heartbeat.lost and not self._interrupted():
                self._log(f"failed: {fault_of(error)[0]}")
            raise

    def _run(self) -> bool:
        ended, final, detail, sb3_zip = None, None, "", ""
        try:
            ended = self._train()
        except Exception as error:
            if self._heartbeat.lost or self._interrupted():
                raise
            fault, detail = fault_of(error)
            note_fault(fault, now=database_now())
            final = final_fault(self._job, fault)
            if final is None or not self._best:
                raise
        done = False
        if ended is not None and ended.network and not self._last:
            self._best = self._last = ended.network  # it ended before its first update
        try:
            if (
                ended is not None and self._job.keeps_models
            ):  # before there are models: what cannot be kept is tried again, and makes them once
                sb3_zip = keep_sb3(job=self._job, lease=self._lease, ended=ended)
            done = self._finish(ended, final, sb3_zip, detail)
        finally:
            if not done:
                delete_stored([sb3_zip])
        return done

    def _finish(self, ended: Ended | None, final: PaddockError | None, sb3_zip: str = "", detail: str = "") -> bool:
        models = self._admitted() if self._job.keeps_models else None
        if final is not None:
            self._log(f"ended early: {final}")
        elif ended is not None:
            call = "" if ended.reward_ms is None else f"; {ended.reward_ms:.3g} ms a call of the reward function"
            self._log(f"over after {ended.steps} steps in {ended.seconds:.1f} s: {ended.why}{call}")
        return finish_training(
            job=self._job,
            lease=self._lease,
            ended=ended,
            models=models,
            sb3_zip=sb3_zip,
            fault=final,
            detail=detail,
            now=database_now(),
        )

    def _keep_models(self, final: PaddockError) -> bool:
        """Nothing is trained any more: what the newest readable checkpoint holds becomes the models."""
        fault: Exception = PlatformFault("storage_failed")
        for checkpoint in Checkpoint.objects.filter(job=self._job).order_by("-iteration"):
            try:
                self._best, self._last = networks_of(checkpoint)
                if self._last:
                    return self._finish(None, final)
            except Exception as error:  # a file that is gone or no archive, networks that the gate refuses
                fault = error
        raise fault

    def _newest_checkpoint(self) -> tuple[Checkpoint, bytes] | None:
        for checkpoint in Checkpoint.objects.filter(job=self._job).order_by("-iteration"):
            try:
                blob, networks = read(checkpoint.file.name or ""), networks_of(checkpoint)
            except PlatformFault as fault:
                if fault.code != "file_damaged":
                    raise
                self._log(f"the checkpoint after iteration {checkpoint.iteration} is damaged")
                continue
            self._best, self._last = networks
            return checkpoint, blob
        return None

    def _train(self) -> Ended:
        job = self._job
        start, blob, checkpoint = "", b"", None
        found = self._newest_checkpoint()
        if found is not None:
            start, (checkpoint, blob) = CHECKPOINT, found
            self._log(f"goes on from its checkpoint after iteration {checkpoint.iteration}")
        elif job.cloned_from is not None:
            start, blob = WEIGHTS, read(job.cloned_from.network.onnx.name or "")
        return train(
            spec_of(job, checkpoint),
            self,
            start=start,
            blob=blob,
            asked_to_stop=lambda: self._heartbeat.stop_asked,
            abandoned=lambda: self._heartbeat.lost or self._interrupted(),
        )

    def ready(self) -> None:
        self._log(f"training starts on {self._job.worker}")

    def reward_time(self, milliseconds: float) -> None:
        self._heartbeat.tell({**self._heartbeat.progress, "reward_ms": milliseconds})

    def alive(self, steps: int, seconds: float) -> None:
        self._heartbeat.tell({**self._heartbeat.progress, "steps": steps, "seconds": seconds})

    def iteration(self, iteration: Iteration) -> None:
        values = iteration.values
        self._last = iteration.onnx
        if values["is_best"]:
            self._best = iteration.onnx
        self._heartbeat.tell(
            {
                "iteration": values["number"],
                "steps": values["steps"],
                "seconds": values["seconds"],
                "steps_per_second": values["steps_per_second"],
            }
        )
        record_iteration(job=self._job, lease=self._lease, iteration=iteration, now=database_now())
        lap = f", lap {values['eval_lap_ms'] / 1000:.3f} s" if values["eval_lap_ms"] else ""
        best = ", the best so far" if values["is_best"] else ""
        self._log(
            f"iteration {values['number']}: {values['steps']} steps, progress {values['eval_progress']:.0f} %, "
            f"reward {values['eval_reward']:.1f}{lap}{best}"
        )

    def checkpoint(self, state: SavedState) -> None:
        networks = (self._best or self._last, self._last)
        try:
            keep_checkpoint(job=self._job, lease=self._lease, saved=state, networks=networks, now=database_now())
        except Exception:  # a full disk is no reason to end what may have room again when it is over
            logger.exception("A checkpoint of training %s cannot be kept.", self._job.public_id)

    def printed(self, prints: Prints) -> None:
        record_prints(job=self._job, lease=self._lease, prints=prints, now=database_now())

    def seen(self, sight: Sight) -> None:
        progress = self._heartbeat.progress
        if "seconds" in progress:  # else there is no progress yet to store it with
            self._heartbeat.tell({**progress, "seen": sight_document(sight)})

    def _admitted(self) -> tuple[TrainedModel, TrainedModel]:
        for left in reversed(range(_ADMISSIONS_TRIED)):
            try:
                return admit_networks(job=self._job, best=self._best or self._last, last=self._last, now=database_now())
            except PlatformFault as fault:
                if fault.code != "upload_busy" or not left:
                    raise
                sleep(_ADMISSION_WAIT_S)
        raise AssertionError("unreachable")

    def _log(self, line: str) -> None:
        if TRAININGS.held(self._job.pk, self._lease).exists():
            append_log(job_id=self._job.pk, line=line, now=database_now())


def sight_document(sight: Sight) -> SightDocument:
    png = io.BytesIO()
    Image.frombytes("L", (SIGHT_COLUMNS, SIGHT_ROWS), sight.picture).save(png, "PNG", compress_level=1)
    picture = base64.b64encode(png.getvalue()).decode()
    return {"png": picture, "steering": sight.steering, "speed": sight.speed, "value": sight.value}
