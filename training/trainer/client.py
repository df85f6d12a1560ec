"""Starts a training in the sandbox and checks every message of it. Imports no torch."""

import json
import select
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from evaluation.sandbox.frames import FrameClosed, FrameError, read_message, write_message
from evaluation.sandbox.launch import launch
from evaluation.sandbox.limits import TRAINER
from evaluation.sandbox.lock import EXIT_MEMORY
from evaluation.sandbox.process import FROM_OUTSIDE, SandboxedProcess
from paddock.errors import PaddockError, PlatformFault, UserFault, fault_from_dict
from paddock.errors.reasons import REASONS

from ..rewards.reasons import REWARD_REASONS
from ..rewards.sandbox.allowed_modules import wanted_modules
from ..rewards.sandbox.call_limits import KEPT_CHARACTERS, line_in
from ..rewards.sandbox.client import ended_by, line_of
from .messages import (
    GREATEST,
    Ended,
    Iteration,
    Prints,
    SavedState,
    Sight,
    bounds_of,
    iteration_of,
    prints_of,
    reward_ms_of,
    sight_of,
    whole,
)
from .spec import TrainerSpec

MODULE = "training.trainer.process"
WEIGHTS, CHECKPOINT = "weights", "checkpoint"

_START_S = 120.0  # imports take 1.5 s of processor time; this host may be busy
_MESSAGE_S = 30.0
_SILENCE_S = 60.0  # the process sends a message about once a second
_PATIENCE_S = 600.0  # with a process that hardly gets the processor
_FINISH_S = 30.0  # to end in good order: the step of learning that is under way, and what is kept
_OVERTIME_S = 600.0  # the same on a host that gives it less than half of a processor
_REPORT_EVERY_S = 1.0
_STOP_EVERY_S = 0.25
_JSON_LIMIT = 1024 * 1024
_ITERATIONS = 2_000  # of all attempts; a day of the shortest updates makes 900
_ITERATIONS_AT_ONCE, _ITERATIONS_A_SECOND = 20, 10.0
_CHECKPOINT_EVERY_S = 5.0  # on the average; the trainer saves half as often
_SIGHTS_EVERY_S = 0.5  # on the average; the trainer sends them half as often
_PRINTS_EVERY_S = 0.5  # on the average; the trainer sends them half as often
_OWN_FAULTS = ("reward_slow_to_load", "clone_not_ours", "training_diverged", "trainer_error", "boxes_do_not_fit")


class Listener:
    """The callbacks of :func:`train`: called in its thread; their exceptions pass through."""

    def ready(self) -> None:
        """The process is in the sandbox and begins."""

    def reward_time(self, milliseconds: float) -> None:
        """About once a second: mean milliseconds of a call of the reward function."""

    def alive(self, steps: int, seconds: float) -> None:
        """About once a second, independent of the process's messages: control steps and wall seconds so far."""

    def iteration(self, iteration: Iteration) -> None:
        """An evaluation has ended."""

    def checkpoint(self, state: SavedState) -> None:
        """The training can be resumed from here."""

    def printed(self, prints: Prints) -> None:
        """The reward function has printed something, a second ago at most."""

    def seen(self, sight: Sight) -> None:
        """About once a second while a car drives: its camera picture and the policy's output."""


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
    """Train to the end; no process is left afterwards.

    ``start``: ``"weights"`` (``blob`` is the canonical ONNX of the model to be cloned), ``"checkpoint"`` (``blob`` is
    :attr:`SavedState.state`) or nothing. ``asked_to_stop`` ends the training in good order, ``abandoned`` at once with
    UserFault("stopped"); both are polled about four times a second. All seconds are measured here, because the function
    could stop the clock of its process. A training that does not end is cut off, see :class:`Ended`.

    Raises UserFault (``reward_...``, ``clone_not_ours``, ``training_memory``, ``training_diverged``) and PlatformFault
    (``trainer_...``, ``sandbox_...``, ``host_overloaded``), with the process's stderr as a note.
    """
    wall = max(1.0, spec.stop_seconds - spec.seconds_before) + _START_S + _FINISH_S + _OVERTIME_S
    limits = replace(TRAINER, wall_s=wall)
    arguments = [json.dumps(spec.warmth), ",".join(wanted_modules(spec.reward_code))]
    with launch(MODULE, limits=limits, arguments=arguments, level=level, random=True) as process:
        process.widen_pipes()
        run = _TrainingRun(spec, process, listener, asked_to_stop, abandoned)
        try:
            run.begin(start, blob)
            return run.listen()
        except PaddockError as fault:
            if text := process.stderr_text().strip():
                fault.add_note(f"stderr of the trainer:\n{text}")
            raise


class _TrainingRun:
    """One training of :func:`train`."""

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
        self._stop_sent_at: float | None = None
        self._bounds = bounds_of(spec)
        self._last, self._last_cpu = time.monotonic(), 0.0
        self._reported_at = 0.0
        self._began: float | None = None  # when it got the training, with the racer's code
        self._number = spec.iterations_before
        self._saved = spec.iterations_before  # the last checkpoint's iteration
        self._reward_ms: float | None = None
        self._steps = self._iterations = self._printed = 0
        self._counts: Counter[str] = Counter()  # messages by kind

    def begin(self, start: str, blob: bytes) -> None:
        """Wait until the process is locked, and send it the training."""
        deadline = time.monotonic() + _START_S
        ready, _ = self._hear(deadline)
        if "ready" not in ready:
            raise PlatformFault("trainer_protocol")
        self._listener.ready()
        question = {"spec": asdict(self._spec), "start": start}
        self._began = time.monotonic()
        try:
            write_message(self._process.stdin, question, [blob] if start else [], deadline)
        except FrameError:
            raise self._death() from None
        self._heard()

    def listen(self) -> Ended:
        poller = select.poll()
        poller.register(self._process.stdout, select.POLLIN)
        while True:
            if self._abandoned():
                raise UserFault("stopped")
            self._pass_on_stop()
            self._report_time()
            if self._overdue():
                return self._cut_off()
            if not poller.poll(_STOP_EVERY_S * 1000):
                self._check_silence()
                continue
            message, blobs = self._hear(time.monotonic() + _MESSAGE_S)
            ended = self._take(message, blobs)
            if ended is not None:
                return ended
            self._heard()

    @property
    def _seconds(self) -> float:
        """Wall seconds of this training, with those of earlier attempts."""
        return self._spec.seconds_before + self._here

    @property
    def _here(self) -> float:
        """Wall seconds of this attempt."""
        return 0.0 if self._began is None else time.monotonic() - self._began

    def _take(self, message: Any, blobs: list[bytes]) -> Ended | None:
        try:
            result = self._understood(message, blobs)
        except (KeyError, TypeError, ValueError, AttributeError):
            raise self._unreadable() from None
        if isinstance(result, Ended):
            return result
        result()  # outside the try: the listener's exceptions pass through
        return None

    def _understood(self, message: Any, blobs: list[bytes]) -> Ended | Callable[[], None]:
        """The end, or the call of the listener. Raises PaddockError, and ValueError, KeyError, TypeError or
        AttributeError for an invalid message."""
        if "alive" in message:
            self._steps = whole(message["alive"]["steps"])
            self._reward_ms = reward_ms_of(message["alive"])
            return self._report_time
        if "iteration" in message:
            return partial(self._listener.iteration, self._next_iteration(message, blobs))
        if "checkpoint" in message:
            return partial(self._listener.checkpoint, self._next_checkpoint(message["checkpoint"], blobs))
        if "printed" in message:
            return partial(self._listener.printed, self._next_prints(message["printed"]))
        if "seen" in message:
            return partial(self._listener.seen, self._next_sight(message["seen"], blobs))
        if "error" in message:
            raise self._fault(message["error"])
        return self._end(message, blobs)

    def _end(self, message: Any, blobs: list[bytes]) -> Ended:
        why, (sb3_zip, *networks) = message["done"], blobs
        network = networks[0] if networks else b""
        if not 0 < len(sb3_zip) <= self._bounds.state or len(networks) > 1 or len(network) > self._bounds.network:
            raise ValueError("no end of a training")
        if bool(self._iterations) == bool(network):
            raise ValueError("a network where none is due, or none where one is")
        if why not in ("time", "stopped", *(("clean_laps", "steps") if self._iterations else ())):
            raise ValueError("no reason to end")
        steps = whole(message["steps"], 0 if why == "stopped" else 1)
        return Ended(why, steps, self._seconds, sb3_zip, network, reward_ms_of(message))

    def _next_iteration(self, message: Any, blobs: list[bytes]) -> Iteration:
        iteration = iteration_of(message, blobs, self._bounds.network)
        number = iteration.values["number"]
        self._iterations += 1
        if number != self._number + 1 or number > _ITERATIONS:
            raise ValueError("not the next iteration")
        if self._iterations > _ITERATIONS_AT_ONCE + _ITERATIONS_A_SECOND * self._here:
            raise ValueError("more than a training learns")
        self._number, self._steps = number, iteration.values["steps"]
        iteration.values["seconds"] = round(self._seconds, 3)
        return iteration

    def _next_checkpoint(self, about: Any, blobs: list[bytes]) -> SavedState:
        (state,) = blobs
        self._count("checkpoint", 2, _CHECKPOINT_EVERY_S)
        if about["iteration"] != self._number or self._number <= self._saved:
            raise ValueError("a checkpoint of nothing new")
        if not 0 < len(state) <= self._bounds.state:
            raise ValueError("no checkpoint of this network")
        self._saved = self._number
        return SavedState(self._number, whole(about["steps"]), self._seconds, state)

    def _next_prints(self, report: Any) -> Prints:
        prints = prints_of(report)
        self._count("printed", 5, _PRINTS_EVERY_S)
        self._printed += len(prints.kept)
        if self._printed > KEPT_CHARACTERS:
            raise ValueError("more than a training prints")
        return prints

    def _next_sight(self, report: Any, blobs: list[bytes]) -> Sight:
        self._count("seen", 5, _SIGHTS_EVERY_S)
        return sight_of(report, blobs)

    def _count(self, kind: str, at_once: int, every_s: float) -> None:
        """Raise ValueError for more messages of a kind than a training sends."""
        self._counts[kind] += 1
        if self._counts[kind] > at_once + self._here / every_s:
            raise ValueError(f"too many messages: {kind}")

    def _overdue(self) -> bool:
        """Whether it should have ended: the racer's code may prevent its end."""
        late = self._seconds - self._spec.stop_seconds
        if self._stop_sent_at is not None:
            late = max(late, time.monotonic() - self._stop_sent_at)
        if late <= _FINISH_S:
            return False
        return late > _OVERTIME_S or not self._starved()

    def _starved(self) -> bool:
        """Whether this host is too busy for the process. A process that waits or computes little is not starved."""
        return self._process.wants_processor() and self._process.cpu_seconds() < self._here / 2

    def _cut_off(self) -> Ended:
        """End a training that does not end itself, with its last reported state. Raises if it reported none."""
        if not self._iterations:
            raise self._stuck("it did not end when it should")
        why = "time" if self._stop_sent_at is None else "stopped"
        return Ended(why, self._steps, self._seconds, b"", reward_ms=self._reward_ms)

    def _stuck(self, how: str) -> PaddockError:
        """The fault for behaviour that only a racer's code can cause; our own default cannot."""
        if not self._spec.reward_code or self._began is None:
            return PlatformFault("trainer_died", how=how)
        return _stuck_at(line_in(self._process.stderr_text()), how)

    def _report_time(self) -> None:
        """Report the seconds by this process's clock, whatever the trainer reports."""
        now = time.monotonic()
        if self._began is not None and now - self._reported_at >= _REPORT_EVERY_S:
            self._reported_at = now
            self._listener.alive(self._steps, self._seconds)
            if self._reward_ms is not None:
                self._listener.reward_time(self._reward_ms)

    def _unreadable(self) -> PaddockError:
        """The fault for a message that the trainer never writes."""
        if not self._spec.reward_code or self._began is None:
            return PlatformFault("trainer_protocol")
        return UserFault("reward_stuck", how="it wrote into the pipe that is not its own")

    def _fault(self, report: Any) -> PaddockError:
        """The reported fault, if its code is one of the process's own; parameters are cut to short plain values."""
        code = report.get("code") if isinstance(report, dict) else None
        if code not in (*REWARD_REASONS, *_OWN_FAULTS) or code not in REASONS:
            return self._unreadable()
        params = {
            str(name)[:40]: value[:500] if isinstance(value, str) else value
            for name, value in dict(report.get("params") or {}).items()
            if isinstance(value, str) or (type(value) in (int, float) and abs(value) <= GREATEST)
        }
        return fault_from_dict({"code": code, "params": params})

    def _pass_on_stop(self) -> None:
        now = time.monotonic()
        if self._stop_sent_at is None and self._asked_to_stop():
            self._stop_sent_at = now
            try:
                write_message(self._process.stdin, {"stop": True}, deadline=now + _MESSAGE_S)
            except FrameError:
                raise self._death() from None

    def _heard(self) -> None:
        self._last, self._last_cpu = time.monotonic(), self._process.cpu_seconds()

    def _check_silence(self) -> None:
        """Raise if the process was silent too long, because of the racer's code or a busy host."""
        silent = time.monotonic() - self._last
        if silent < _SILENCE_S:
            return
        computed = self._process.cpu_seconds() - self._last_cpu
        if computed > _SILENCE_S / 2 or not self._process.wants_processor():
            raise _stuck_at(line_of(self._process), f"nothing was heard for {silent:.0f} s")
        if silent > _PATIENCE_S:
            raise PlatformFault("host_overloaded")

    def _hear(self, deadline: float) -> tuple[Any, list[bytes]]:
        try:
            return read_message(self._process.stdout, deadline, json_limit=_JSON_LIMIT, blob_limit=self._bounds.message)
        except FrameClosed:
            raise self._death() from None
        except FrameError:
            raise self._unreadable() from None

    def _death(self) -> PaddockError:
        """The fault of a process that ended without a message. Only the kernel's signals are trusted, because the code
        can set any exit status."""
        status = self._process.wait(2.0)
        if status == EXIT_MEMORY:
            return UserFault("training_memory", limit_mb=self._process.limits.address_space_mb)
        if status is None:
            return self._stuck("it closed the pipe that is not its own")
        if status in FROM_OUTSIDE:
            return PlatformFault("trainer_died", how=f"signal {-status}")
        return self._stuck(ended_by(status))


def _stuck_at(line: int | None, how: str) -> UserFault:
    return UserFault("reward_stuck", how=how, **({} if line is None else {"line": line}))
