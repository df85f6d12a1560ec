"""From a model and a race to lap times: one policy process, one runner process, and this process between them.

Nothing in an :class:`EvaluationOutcome` but ``wall_s``, ``shares`` and ``peak_mb`` depends on the wall clock.
"""

from __future__ import annotations

import contextlib
import select
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from faults import PaddockError, PlatformFault, UserFault, fault_from_dict
from tracks.geometry import TrackGeometry

from .pair import Pair
from .rivals import check_rivals
from .sandbox.cores import one_core
from .sandbox.frames import FrameClosed, FrameError, read_message, write_message
from .sandbox.launch import SandboxedProcess, widen_pipe
from .sandbox.policy import PolicyProcess, describe, failed_start
from .sandbox.policy_client import OVERAGE_S, STEP_DEADLINE_S, TOTAL_S
from .simulator.engine import cpu_model
from .simulator.rules import RaceRules

WALL_LIMIT_S = 300.0
_START_S = 30.0
_MESSAGE_S = 10.0  # a runner that began to write a message ends it
_STOP_EVERY_S = 0.25


@dataclass(frozen=True)
class RivalCar:
    """Another submitted car in the same world, as in :class:`RaceJob`."""

    onnx: bytes
    metadata: dict[str, Any]


@dataclass(frozen=True)
class RaceJob:
    """What to evaluate. ``metadata``: the model's checked ``model_metadata.json``; ``onnx``: its canonical bytes.

    ``rivals``: cars 1, 2 and 3; the model itself is car 0. Raises UserFault (:func:`evaluation.rivals.check_rivals`).
    """

    track: TrackGeometry
    rules: RaceRules
    onnx: bytes
    metadata: dict[str, Any]
    rivals: tuple[RivalCar, ...] = ()

    def __post_init__(self) -> None:
        check_rivals(self.rules, len(self.rivals))


@dataclass(frozen=True)
class PolicyBudget:
    """A model's time, in wall seconds: a step, what all steps together may take above it, and the whole run."""

    step_deadline_s: float = STEP_DEADLINE_S
    overage_s: float = OVERAGE_S
    total_s: float = TOTAL_S


@dataclass(frozen=True)
class CarOutcome:
    """What came of one car. ``laps``: dicts of :class:`evaluation.simulator.race.LapResult`; times in simulated ms.

    ``trace_csv``: the official sim-trace; ``metrics``: the field's evaluation metrics. ``retired``: the fault that took
    the car off the track while others drove on, ``{"code", "params"}``, or None.
    """

    laps: list[dict[str, Any]]
    end_reason: str
    retired: dict[str, Any] | None
    trace_csv: bytes
    trace_sha256: str
    metrics: dict[str, Any]


@dataclass(frozen=True)
class EvaluationOutcome:
    """What came of an evaluation: car 0 as in :class:`CarOutcome`, and ``rivals``.

    ``course``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}], "bots": [[[x, y, yaw], ... a row], ... a bot]}`` in
    metres and radians. ``order``: the numbers of all cars, winner first. ``shares``: wall seconds in ``start``
    (processes, loading), ``physics``, ``camera``, ``policy`` (of which ``network`` on the models' own CPU clocks, the
    rest pipes) and ``other``. ``peak_mb``: largest resident sets of policies and runner added up.
    """

    laps: list[dict[str, Any]]
    end_reason: str
    simulated_ms: int
    steps: int
    trace_csv: bytes
    trace_sha256: str
    metrics: dict[str, Any]
    engine: str
    versions: dict[str, str]
    cpu_model: str
    wall_s: float
    shares: dict[str, float]
    peak_mb: float
    retired: dict[str, Any] | None = None
    course: dict[str, list] = field(default_factory=dict)
    order: list[int] = field(default_factory=lambda: [0])
    rivals: list[CarOutcome] = field(default_factory=list)


def evaluate(
    job: RaceJob,
    on_progress: Callable[[dict[str, Any]], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    wall_limit_s: float = WALL_LIMIT_S,
    *,
    budget: PolicyBudget | None = None,
    level: int | None = None,
    pair: Pair | None = None,
) -> EvaluationOutcome:
    """Run the job behind the wall. Whatever happens, no process, descriptor or file is left when it returns.

    ``on_progress`` gets dicts of :class:`evaluation.simulator.race.Progress`; ``should_stop`` is asked about four
    times a second, also in between; both are called in this thread, and what they raise goes through. ``wall_limit_s``
    protects the platform from its own simulator: a model's slowness is judged by ``budget``, which must be the smaller.
    ``level``: as for :func:`evaluation.sandbox.launch.launch`. ``pair``: processes that are kept ready, which are used
    up instead of new ones; the result is the same.

    Raises UserFault: ``policy_late``, ``policy_died``, ``policy_memory``, ``policy_protocol``, ``policy_refused``,
    ``non_finite_action``, ``stopped``, and what the simulator says of the model. Raises PlatformFault:
    ``sandbox_unavailable``, ``sandbox_failed``, ``runner_timeout``, ``runner_died``, ``runner_protocol``,
    ``runner_error``; notes on it (``__notes__``) carry what the processes wrote to stderr, for operators.
    """
    started = time.monotonic()
    with pair or Pair(level) as used:
        policy, runner = used.policy, used.runner
        runner.allow(wall_limit_s)
        run = _Run(policy, runner, on_progress, should_stop)
        onnxruntime = run.prepare(job, budget or PolicyBudget())
        prepared = time.monotonic()
        with one_core([policy.process.inner_pid, runner.inner_pid]):
            result, trace_csv = run.drive()
        seconds = {"start": prepared - started, "network": run.network_s()}
        wall_s = time.monotonic() - started
        try:
            result["result"]["versions"]["onnxruntime"] = onnxruntime
            return EvaluationOutcome(
                **result["result"],
                trace_csv=trace_csv,
                cpu_model=cpu_model(),
                wall_s=wall_s,
                shares=_shares({**seconds, **result["seconds"]}, wall_s),
                peak_mb=policy.process.peak_mb() + runner.peak_mb(),
            )
        except (KeyError, TypeError) as error:
            raise run.noted(PlatformFault("runner_protocol")) from error


class _Run:
    """One evaluation in the hands of :func:`evaluate`."""

    def __init__(
        self,
        policy: PolicyProcess,
        runner: SandboxedProcess,
        on_progress: Callable[[dict[str, Any]], None] | None,
        should_stop: Callable[[], bool],
    ) -> None:
        self._policy, self._runner = policy, runner
        self._on_progress, self._should_stop = on_progress, should_stop
        self._network_from = 0.0

    def prepare(self, job: RaceJob, budget: PolicyBudget) -> str:
        """Hand out the job and the network, so that the next message starts the race. The version of onnxruntime."""
        deadline = time.monotonic() + _START_S
        widen_pipe(self._runner.stdin)
        described = {"track": job.track.to_dict(), "rules": job.rules.to_dict(), "metadata": job.metadata}
        try:
            write_message(self._runner.stdin, {**described, "budget": asdict(budget)}, deadline=deadline)
            self._policy.give(job.onnx)
            answer, _ = read_message(self._runner.stdout, deadline)
        except FrameError as error:
            raise failed_start(self._runner, str(error)) from None
        self._raise_error(answer)
        if "header" not in answer:
            raise self.noted(PlatformFault("runner_protocol"))
        self._check_stop()
        version = self._policy.agree(answer["header"])
        self._policy.process.close_pipes()  # from here on they are the runner's alone
        self._network_from = self._policy.process.cpu_seconds()
        return version

    def drive(self) -> tuple[dict[str, Any], bytes]:
        """Start the race and wait for its result: the message and the trace."""
        with contextlib.suppress(FrameError):  # a runner that is gone left a message why, or its exit status
            write_message(self._runner.stdin, {"start": True}, deadline=time.monotonic() + _MESSAGE_S)
        poller = select.poll()
        poller.register(self._runner.stdout, select.POLLIN)
        while True:
            self._check_stop()
            left = self._runner.deadline - time.monotonic()
            if left <= 0:
                raise self.noted(PlatformFault("runner_timeout", limit_s=self._runner.limits.wall_s))
            if not poller.poll(min(left, _STOP_EVERY_S) * 1000 + 1):
                continue
            message, blobs = self._hear()
            self._raise_error(message)
            if "result" in message and len(blobs) == 1:
                return message, blobs[0]
            if "progress" not in message:
                raise self.noted(PlatformFault("runner_protocol"))
            if self._on_progress is not None:
                self._on_progress(message["progress"])

    def network_s(self) -> float:
        """CPU seconds of the policy process since the start of the race."""
        return self._policy.process.cpu_seconds() - self._network_from

    def _check_stop(self) -> None:
        if self._should_stop():
            raise UserFault("stopped")

    def _hear(self) -> tuple[dict[str, Any], list[bytes]]:
        try:
            return read_message(self._runner.stdout, time.monotonic() + _MESSAGE_S)
        except FrameClosed:
            how = describe(self._runner.wait(1.0))
            raise self.noted(PlatformFault("runner_died", how=how)) from None
        except FrameError:
            raise self.noted(PlatformFault("runner_protocol")) from None

    def _raise_error(self, message: dict[str, Any]) -> None:
        if "error" not in message:
            return
        try:
            fault = fault_from_dict(message["error"])
        except (KeyError, TypeError, ValueError):
            raise self.noted(PlatformFault("runner_protocol")) from None
        raise self.noted(self._policy.explain(fault))

    def noted(self, fault: PaddockError) -> PaddockError:
        """Attach what the processes said to stderr, which operators may read and racers may not."""
        for name, process in (("runner", self._runner), ("policy", self._policy.process)):
            if text := process.stderr_text().strip():
                fault.add_note(f"stderr of the {name}:\n{text}")
        return fault


def _shares(seconds: dict[str, float], wall_s: float) -> dict[str, float]:
    """Where the wall time went, see :class:`EvaluationOutcome`."""
    parts = {name: seconds[name] for name in ("start", "physics", "camera", "policy")}
    return {**parts, "network": seconds["network"], "other": wall_s - sum(parts.values())}
