"""Starting a training behind the wall and listening to it. No torch here, and nothing is believed."""

from __future__ import annotations

import json
import math
import select
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from evaluation.sandbox.frames import FrameClosed, FrameError, read_message, write_message
from evaluation.sandbox.launch import SandboxedProcess, launch, widen_pipe
from evaluation.sandbox.limits import TRAINER
from evaluation.sandbox.lock import EXIT_MEMORY
from evaluation.simulator.trace import LABELS
from faults import PaddockError, PlatformFault, UserFault, fault_from_dict
from faults.reasons import REASONS
from faults.reasons.training import REWARD_REASONS

from ..rewards.ask import line_of
from ..rewards.modules import wanted_modules
from ..rewards.watch import line_in
from .spec import TrainerSpec

MODULE = "training.trainer.process"
WEIGHTS, CHECKPOINT = "weights", "checkpoint"

_START_S = 120.0  # imports take 1.5 s of processor time; this host may be busy
_MESSAGE_S = 30.0
_SILENCE_S = 60.0  # the process tells of itself every second or so
_PATIENCE_S = 600.0  # with a process that hardly gets the processor
_FINISH_S = 60.0
_STOP_EVERY_S = 0.25
_JSON_LIMIT = 1024 * 1024
_BLOB_LIMIT = 48 * 1024 * 1024
_NETWORK_LIMIT = 16 * 1024 * 1024
_EPISODES, _TRIALS, _PLACES = 200, 10, 400
_GREATEST = 1e12


@dataclass(frozen=True)
class Iteration:
    """One look at the car: see ``training.models.TrainingIteration`` for the names. ``driving``: [[x, y, yaw, speed],
    ...]; ``onnx``: the policy as it is; ``simtrace``: a gzipped CSV or nothing."""

    values: dict[str, Any]
    driving: list[list[float]]
    onnx: bytes
    simtrace: bytes


@dataclass(frozen=True)
class SavedState:
    """A checkpoint: bytes that only the trainer reads again."""

    iteration: int
    steps: int
    seconds: float
    state: bytes


@dataclass(frozen=True)
class Ended:
    """How a training ended by itself: ``why`` is clean_laps, time, steps or stopped."""

    why: str
    steps: int
    seconds: float
    sb3_zip: bytes


class Listener:
    """What :func:`train` tells of; each method is called in its thread, and what it raises goes through."""

    def ready(self) -> None:
        """The process stands behind the wall and begins."""

    def alive(self, steps: int, seconds: float) -> None:
        """About once a second: control steps and wall seconds so far."""

    def iteration(self, iteration: Iteration) -> None:
        """The car was looked at."""

    def checkpoint(self, state: SavedState) -> None:
        """The training could go on from here."""


def train(
    spec: TrainerSpec,
    listener: Listener,
    *,
    start: str = "",
    blob: bytes = b"",
    asked_to_stop: Callable[[], bool] = lambda: False,
    abandoned: Callable[[], bool] = lambda: False,
    level: int | None = None,
) -> Ended:
    """Train to the end. Whatever happens, no process is left when it returns.

    ``start``: ``"weights"`` (``blob`` is the canonical ONNX of the model to be cloned), ``"checkpoint"`` (``blob`` is
    :attr:`SavedState.state`) or nothing. ``asked_to_stop`` ends the training in good order, ``abandoned`` at once with
    UserFault("stopped"); both are asked about four times a second.

    Raises UserFault (``reward_...``, ``clone_not_ours``, ``training_memory``) and PlatformFault (``trainer_...``,
    ``sandbox_...``, ``host_overloaded``), with what the process wrote to stderr as a note.
    """
    wall = max(1.0, spec.stop_seconds - spec.seconds_before) + _START_S + _FINISH_S + _PATIENCE_S
    limits = replace(TRAINER, wall_s=wall)
    arguments = [json.dumps(spec.warmth), ",".join(wanted_modules(spec.reward_code))]
    with launch(MODULE, limits=limits, arguments=arguments, level=level, random=True) as process:
        widen_pipe(process.stdin)
        widen_pipe(process.stdout)
        run = _Run(spec, process, listener, asked_to_stop, abandoned)
        try:
            run.begin(start, blob)
            return run.listen()
        except PaddockError as fault:
            if text := process.stderr_text().strip():
                fault.add_note(f"stderr of the trainer:\n{text}")
            raise


class _Run:
    """One training in the hands of :func:`train`."""

    def __init__(
        self,
        spec: TrainerSpec,
        process: SandboxedProcess,
        listener: Listener,
        asked_to_stop: Callable[[], bool],
        abandoned: Callable[[], bool],
    ) -> None:
        self._spec, self._process, self._listener = spec, process, listener
        self._asked_to_stop, self._abandoned = asked_to_stop, abandoned
        self._told_to_stop: float | None = None
        self._last, self._last_cpu = time.monotonic(), 0.0

    def begin(self, start: str, blob: bytes) -> None:
        """Wait until the process is locked, and hand it the training."""
        deadline = time.monotonic() + _START_S
        ready, _ = self._hear(deadline)
        if "ready" not in ready:
            raise PlatformFault("trainer_protocol")
        self._listener.ready()
        question = {"spec": self._spec.to_dict(), "start": start}
        try:
            write_message(self._process.stdin, question, [blob] if start else [], deadline)
        except FrameError:
            raise self._death() from None
        self._heard()

    def listen(self) -> Ended:
        """Hear it out."""
        poller = select.poll()
        poller.register(self._process.stdout, select.POLLIN)
        while True:
            if self._abandoned():
                raise UserFault("stopped")
            self._pass_on_stop()
            if not poller.poll(_STOP_EVERY_S * 1000):
                self._check_silence()
                continue
            message, blobs = self._hear(time.monotonic() + _MESSAGE_S)
            ended = self._take(message, blobs)
            if ended is not None:
                return ended
            self._heard()

    def _take(self, message: dict[str, Any], blobs: list[bytes]) -> Ended | None:
        try:
            if "alive" in message:
                about = message["alive"]
                self._listener.alive(_whole(about["steps"]), _number(about["seconds"]))
            elif "iteration" in message:
                self._listener.iteration(_iteration(message, blobs))
            elif "checkpoint" in message:
                about, (state,) = message["checkpoint"], blobs
                saved = SavedState(_whole(about["iteration"]), _whole(about["steps"]), _number(about["seconds"]), state)
                self._listener.checkpoint(saved)
            elif "done" in message:
                (sb3_zip,) = blobs
                why = message["done"] if message["done"] in ("clean_laps", "time", "steps", "stopped") else "time"
                return Ended(why, _whole(message["steps"]), _number(message["seconds"]), sb3_zip)
            elif "error" in message:
                raise self._fault(message["error"])
            else:
                raise ValueError("no such message")
        except (KeyError, TypeError, ValueError, AttributeError):
            raise PlatformFault("trainer_protocol") from None
        return None

    def _fault(self, said: Any) -> PaddockError:
        """The fault that the process reports, if it may report it: its own codes, short plain parameters."""
        code = said.get("code") if isinstance(said, dict) else None
        known = (*REWARD_REASONS, "clone_not_ours", "trainer_error", "boxes_do_not_fit")
        if code not in known or code not in REASONS:
            return PlatformFault("trainer_protocol")
        params = {
            str(name)[:40]: value[:500] if isinstance(value, str) else value
            for name, value in dict(said.get("params") or {}).items()
            if isinstance(value, str) or (type(value) in (int, float) and abs(value) <= _GREATEST)
        }
        return fault_from_dict({"code": code, "params": params})

    def _pass_on_stop(self) -> None:
        now = time.monotonic()
        if self._told_to_stop is None and self._asked_to_stop():
            self._told_to_stop = now
            try:
                write_message(self._process.stdin, {"stop": True}, deadline=now + _MESSAGE_S)
            except FrameError:
                raise self._death() from None

    def _heard(self) -> None:
        self._last, self._last_cpu = time.monotonic(), self._process.cpu_seconds()

    def _check_silence(self) -> None:
        """A process that says nothing computes in the stranger's code, or sleeps there; or this host is too busy."""
        silent = time.monotonic() - self._last
        if silent < _SILENCE_S:
            return
        computed = self._process.cpu_seconds() - self._last_cpu
        if computed > _SILENCE_S / 2 or not self._process.wants_processor():
            line = line_of(self._process)
            where = {} if line is None else {"line": line}
            raise UserFault("reward_stuck", how=f"nothing was heard for {silent:.0f} s", **where)
        if silent > _PATIENCE_S:
            raise PlatformFault("host_overloaded")

    def _hear(self, deadline: float) -> tuple[dict[str, Any], list[bytes]]:
        try:
            return read_message(self._process.stdout, deadline, json_limit=_JSON_LIMIT, blob_limit=_BLOB_LIMIT)
        except FrameClosed:
            raise self._death() from None
        except FrameError:
            raise PlatformFault("trainer_protocol") from None

    def _death(self) -> PaddockError:
        """It ended without a word: of memory, by what the reward function did, or by somebody's signal."""
        status = self._process.wait(2.0)
        if status == EXIT_MEMORY:
            return UserFault("training_memory", limit_mb=self._process.limits.address_space_mb)
        line = line_in(self._process.stderr_text()) if self._spec.reward_code else None
        if line is not None:  # it crashed in the stranger's function
            return UserFault("reward_stuck", how="it crashed", line=line)
        if status is not None and 0 <= status < 70 and self._spec.reward_code:
            return UserFault("reward_stuck", how=f"exit status {status}")
        how = "still there" if status is None else f"signal {-status}" if status < 0 else f"exit status {status}"
        return PlatformFault("trainer_died", how=how)


def _iteration(message: dict[str, Any], blobs: list[bytes]) -> Iteration:
    """What was said, if it has the form and the size of an iteration. Raises KeyError, TypeError, ValueError."""
    said = message["iteration"]
    onnx, simtrace = blobs
    if not 0 < len(onnx) <= _NETWORK_LIMIT:
        raise ValueError("no network")
    values = {
        "number": _whole(said["number"], 1),
        "steps": _whole(said["steps"]),
        "seconds": _number(said["seconds"]),
        "steps_per_second": _number(said["steps_per_second"]),
        "episodes": [_episode(one) for one in said["episodes"][:_EPISODES]],
        "eval_trials": [_episode(one) for one in said["eval_trials"][:_TRIALS]],
        "eval_progress": min(max(_number(said["eval_progress"]), 0.0), 100.0),
        "eval_reward": _number(said["eval_reward"]),
        "eval_lap_ms": None if said["eval_lap_ms"] is None else _whole(said["eval_lap_ms"]),
        "eval_clean_laps": min(_whole(said["eval_clean_laps"]), _TRIALS),
        "is_best": said["is_best"] is True,
    }
    for name in ("mean_reward", "mean_progress", "entropy", "policy_loss", "value_loss"):
        values[name] = None if said[name] is None else _number(said[name])
    driving = [[_number(value) for value in place[:4]] for place in message["driving"][:_PLACES]]
    return Iteration(values, driving, onnx, simtrace)


def _episode(said: dict[str, Any]) -> dict[str, Any]:
    known = {
        "reward": _number(said["reward"]),
        "progress": min(max(_number(said["progress"]), 0.0), 100.0),
        "status": said["status"] if said["status"] in LABELS.values() else LABELS["in_progress"],
        "steps": _whole(said["steps"]),
        "time_ms": _whole(said["time_ms"]),
    }
    for name in ("episode", "lap_ms"):
        if name in said:
            known[name] = None if said[name] is None else _whole(said[name])
    return known


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value) or abs(value) > _GREATEST:
        raise ValueError("not a number")
    return float(value)


def _whole(value: Any, least: int = 0) -> int:
    if type(value) is not int or not least <= value <= 2**31 - 1:
        raise ValueError("not a whole number")
    return value
