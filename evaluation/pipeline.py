"""From models and a race to lap times: a policy process a model, one runner process, and this process between them.

Nothing in an :class:`EvaluationOutcome` but ``wall_s``, ``shares`` and ``peak_mb`` depends on the wall clock, and
nothing but these and ``ways`` on the processor.
"""

from __future__ import annotations

import contextlib
import json
import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Protocol

from paddock.errors import PaddockError, PlatformFault, UserFault, fault_from_dict
from paddock.geometry.track import TrackGeometry
from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import EXCEEDED, WAYS
from paddock.rules.race import RaceRules
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.engine import cpu_model

from .crew import Crew
from .rivals import check_rivals
from .sandbox.cores import PATIENCE_S, one_core
from .sandbox.frames import FrameClosed, FrameError, read_message, write_message
from .sandbox.launch import widen_pipe
from .sandbox.policy import describe, failed_start
from .sandbox.policy_client import OVERAGE_S, STEP_DEADLINE_S, TOTAL_S
from .venue import Venue

WALL_LIMIT_S = 300.0
_START_S = 30.0
_MESSAGE_S = 10.0  # a runner that began to write a message ends it
_STOP_EVERY_S = 0.25


class SubmittedCar(Protocol):
    """What a policy process is given, and what the runner must know of it, as in :class:`RaceJob`."""

    @property
    def onnx(self) -> bytes: ...
    @property
    def metadata(self) -> dict[str, Any]: ...
    @property
    def facts(self) -> dict[str, Any] | None: ...


@dataclass(frozen=True)
class RivalModel:
    """Another submitted car in the same world, as in :class:`RaceJob`."""

    onnx: bytes
    metadata: dict[str, Any]
    facts: dict[str, Any] | None = None


@dataclass(frozen=True)
class RaceJob:
    """What to evaluate. ``metadata``: the model's checked ``model_metadata.json``; ``onnx``: its canonical bytes;
    ``facts``: what its admission found out (:class:`paddock.network.bound.NetworkFacts`), None if that is not known.

    ``rivals``: cars 1, 2 and 3; the model itself is car 0. ``look``: what cameras see of the track, the name of one of
    ``paddock.simulator.camera.theme.THEMES``. Raises UserFault (:func:`evaluation.rivals.check_rivals`).
    """

    track: TrackGeometry
    rules: RaceRules
    onnx: bytes
    metadata: dict[str, Any]
    rivals: tuple[RivalModel, ...] = ()
    look: str = OFFICIAL.name
    facts: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        check_rivals(self.rules, len(self.rivals))

    @property
    def venue(self) -> Venue:
        """Where the race is."""
        return Venue(self.track, self.rules.direction, self.look)


@dataclass(frozen=True)
class PolicyBudget:
    """A model's time, in wall seconds: a step, what all steps together may take above it, and the whole run."""

    step_deadline_s: float = STEP_DEADLINE_S
    overage_s: float = OVERAGE_S
    total_s: float = TOTAL_S


@dataclass(frozen=True)
class CompetitorOutcome:
    """What came of one car. ``laps``: dicts of :class:`paddock.simulator.race.LapResult`; times in simulated ms.

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
    """What came of an evaluation: car 0 as in :class:`CompetitorOutcome`, and ``rivals``.

    ``layout``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}], "bots": [[[x, y, yaw], ... a row], ... a bot]}`` in
    metres and radians. ``order``: the numbers of all cars, winner first. ``simulated_ms`` and ``steps``: until the last
    car was done. ``shares``: wall seconds in ``start`` (processes, loading, waiting for a core), ``physics`` (Bullet's
    step, what it is told and asked of the cars), ``camera``, ``policy`` (of
    which ``network`` on the models' own CPU clocks, the rest pipes) and ``other``. ``peak_mb``: the largest resident
    sets of policies and runner added up. ``ways``: for each car, how many steps were answered in each of the ways of
    :data:`paddock.network.policy_wire.WAYS`. ``inexact``: numbers of cars whose bound did not hold
    (:class:`paddock.network.bound.NetworkFacts`); all was driven again without it.
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
    layout: dict[str, list] = field(default_factory=dict)
    order: list[int] = field(default_factory=lambda: [0])
    rivals: list[CompetitorOutcome] = field(default_factory=list)
    ways: list[list[int]] = field(default_factory=list)
    inexact: list[int] = field(default_factory=list)


def evaluate(
    job: RaceJob,
    on_progress: Callable[[dict[str, Any]], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    wall_limit_s: float = WALL_LIMIT_S,
    *,
    budget: PolicyBudget | None = None,
    level: int | None = None,
    crew: Crew | None = None,
) -> EvaluationOutcome:
    """Run the job in the sandbox. Whatever happens, no process, descriptor or file is left when it returns.

    ``on_progress`` gets dicts of :class:`paddock.simulator.race.Progress`; ``should_stop`` is asked about four
    times a second, also in between; both are called in this thread, and what they raise goes through. ``wall_limit_s``
    protects the platform from its own simulator and is for each car: a model's slowness is judged by ``budget``, which
    must be the smaller and which every model has for itself. ``level``: as for
    :func:`evaluation.sandbox.launch.launch`. ``crew``: processes that are kept ready, which are used up instead of new
    ones; the result is the same.

    Raises UserFault: ``policy_late``, ``policy_died``, ``policy_memory``, ``policy_protocol``, ``policy_refused``,
    ``non_finite_action`` (these only of a car that is alone; one with rivals retires instead), ``stopped``, and what
    the simulator says of the model or of the layout. Raises PlatformFault: ``sandbox_unavailable``,
    ``sandbox_failed``, ``host_overloaded``, ``runner_timeout``, ``runner_died``, ``runner_protocol``,
    ``runner_error``; notes on it (``__notes__``) carry what the processes wrote to stderr, for operators.
    """
    outcome = _evaluate(job, on_progress, should_stop, wall_limit_s, budget or PolicyBudget(), level, crew)
    inexact = [number for number, ways in enumerate(outcome.ways) if ways[EXCEEDED]]
    if not inexact:
        return outcome
    # A bound did not hold, so earlier answers may have been wrong: once more, with exact answers only.
    job = _exactly(job, inexact)
    outcome = _evaluate(job, on_progress, should_stop, wall_limit_s, budget or PolicyBudget(), level, None)
    return replace(outcome, inexact=inexact)


def _exactly(job: RaceJob, numbers: Sequence[int]) -> RaceJob:
    """The job with cars whose answers are all computed in float64."""
    exact = NetworkFacts(bound=None).to_dict()
    rivals = tuple(
        replace(rival, facts=exact) if number in numbers else rival for number, rival in enumerate(job.rivals, 1)
    )
    return replace(job, facts=exact if 0 in numbers else job.facts, rivals=rivals)


def _evaluate(
    job: RaceJob,
    on_progress: Callable[[dict[str, Any]], None] | None,
    should_stop: Callable[[], bool],
    wall_limit_s: float,
    budget: PolicyBudget,
    level: int | None,
    crew: Crew | None,
) -> EvaluationOutcome:
    """:func:`evaluate` without a second look."""
    started = time.monotonic()
    cars = 1 + len(job.rivals)
    with crew or Crew(cars, level) as used:
        used.enlist(cars)
        used.runner.allow(wall_limit_s * cars)
        run = SandboxedRun(used, on_progress, should_stop)
        told = {**used.described(job.venue), "rules": job.rules.to_dict(), "budget": asdict(budget)}
        onnxruntime = run.prepare([job, *job.rivals], told)
        pids = [process.inner_pid for process in run.processes.values()]
        with one_core(pids, PATIENCE_S, run.check_stop):
            ready = time.monotonic()
            used.runner.allow(wall_limit_s * cars)  # to wait for others was none of its time
            message, blobs = run.drive()
        seconds = {"start": ready - started, "network": run.network_s()}
        wall_s = time.monotonic() - started
        try:
            return _outcome(
                message["result"],
                blobs,
                run.retired,
                onnxruntime,
                ways=_ways(message["ways"], cars),
                cpu_model=cpu_model(),
                wall_s=wall_s,
                shares=_shares({**seconds, **message["seconds"]}, wall_s),
                peak_mb=sum(process.peak_mb() for process in run.processes.values()),
            )
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise run.noted(PlatformFault("runner_protocol")) from error


class SandboxedRun:
    """One job in the hands of this process: of :func:`evaluate`, or of :func:`evaluation.drives.drive_all`.

    ``processes``: the runner and the policies by the names that operators read. ``retired``: the fault of each car that
    retired, by its number.
    """

    def __init__(
        self,
        crew: Crew,
        on_progress: Callable[[dict[str, Any]], None] | None,
        should_stop: Callable[[], bool],
    ) -> None:
        self._crew, self._policies, self._runner = crew, crew.policies, crew.runner
        self._on_progress, self._should_stop = on_progress, should_stop
        self._network_from = [0.0] * len(crew.policies)
        self._network_s = [0.0] * len(crew.policies)
        self.retired: dict[int, UserFault] = {}
        names = ["policy", *(f"policy of car {number}" for number in range(1, len(crew.policies)))]
        self.processes = {"runner": crew.runner}
        self.processes |= {name: policy.process for name, policy in zip(names, crew.policies, strict=True)}

    def prepare(self, cars: Sequence[SubmittedCar], told: dict[str, Any]) -> str:
        """Hand out the job (``told``, in the runner's words) and the networks, so that the next message starts the
        race. The version of onnxruntime."""
        deadline = time.monotonic() + _START_S
        widen_pipe(self._runner.stdin)
        try:
            write_message(self._runner.stdin, {**told, "metadata": [car.metadata for car in cars]}, deadline=deadline)
            for number, car in enumerate(cars):
                with self._retiring(number):
                    self._policies[number].give(car.onnx, car.facts)
            answer, _ = read_message(self._runner.stdout, max(deadline, time.monotonic() + _MESSAGE_S))
        except FrameError as error:
            raise failed_start(self._runner, str(error)) from None
        self._raise_error(answer)
        if len(answer.get("headers", ())) != len(cars):
            raise self.noted(PlatformFault("runner_protocol"))
        versions = []
        for number, header in enumerate(answer["headers"]):
            self.check_stop()
            if number not in self.retired:
                with self._retiring(number):
                    versions.append(self._policies[number].agree(header))
        for number, policy in enumerate(self._policies):
            policy.process.close_pipes()  # from here on they are the runner's alone
            self._network_from[number] = policy.process.cpu_seconds()
        return versions[0] if versions else ""

    def drive(self) -> tuple[dict[str, Any], list[bytes]]:
        """Start the race and wait for its result: the message and its blobs."""
        with contextlib.suppress(FrameError):  # a runner that is gone left a message why, or its exit status
            write_message(self._runner.stdin, {"start": True}, deadline=time.monotonic() + _MESSAGE_S)
        poller = select.poll()
        poller.register(self._runner.stdout, select.POLLIN)
        while True:
            self.check_stop()
            left = self._runner.deadline - time.monotonic()
            if left <= 0:
                raise self.noted(PlatformFault("runner_timeout", limit_s=self._runner.limits.wall_s))
            if not poller.poll(min(left, _STOP_EVERY_S) * 1000 + 1):
                continue
            message, blobs = self._hear()
            self._raise_error(message)
            if "result" in message:
                return message, blobs
            if "retired" in message:
                self._hear_of_retired(message["retired"])
            elif "progress" not in message:
                raise self.noted(PlatformFault("runner_protocol"))
            elif self._on_progress is not None:
                self._on_progress(message["progress"])

    def network_s(self) -> float:
        """CPU seconds of the policy processes since the start of the race."""
        for number in range(len(self._policies)):
            self._note_network(number)
        return sum(self._network_s)

    def noted(self, fault: PaddockError) -> PaddockError:
        """Attach what the processes said to stderr, which operators may read and racers may not."""
        for name, process in self.processes.items():
            if text := process.stderr_text().strip():
                fault.add_note(f"stderr of the {name}:\n{text}")
        return fault

    def check_stop(self) -> None:
        """Raises UserFault ``stopped`` where the run is to end."""
        if self._should_stop():
            raise UserFault("stopped")

    @contextlib.contextmanager
    def _retiring(self, number: int) -> Iterator[None]:
        """Whoever races others and fails at the start retires; alone its fault goes through."""
        try:
            yield
        except UserFault as fault:
            if len(self._policies) == 1:
                raise
            self._retire(number, fault)

    def _hear_of_retired(self, said: dict[str, Any]) -> None:
        """The runner found a policy at fault. Whose fault it was shows now: later it might look otherwise."""
        try:
            number, fault = said["car"], fault_from_dict(said["error"])
            policy = self._policies[number]
        except (KeyError, TypeError, ValueError, IndexError):
            raise self.noted(PlatformFault("runner_protocol")) from None
        if number not in self.retired:
            explained = policy.explain(fault)
            if not isinstance(explained, UserFault):
                raise self.noted(explained)
            self._retire(number, explained)

    def _retire(self, number: int, fault: UserFault) -> None:
        """Write down why, and end the process: it would take the others' processor."""
        self.retired[number] = fault
        self._note_network(number)
        self._policies[number].process.peak_mb()
        self._policies[number].process.kill()

    def _note_network(self, number: int) -> None:
        used = self._policies[number].process.cpu_seconds() - self._network_from[number]
        self._network_s[number] = max(self._network_s[number], used)

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
        raise self.noted(self._policies[0].explain(fault))


def _outcome(
    result: dict[str, Any], blobs: list[bytes], retired: dict[int, UserFault], onnxruntime: str, **measured: Any
) -> EvaluationOutcome:
    """What the runner's last message says. Raises KeyError, TypeError, ValueError, IndexError for one of no form."""
    layout, *traces = blobs
    first, *rivals = [
        CompetitorOutcome(**{**car, "retired": _why(car["retired"], retired.get(number))}, trace_csv=trace)
        for number, (car, trace) in enumerate(zip(result.pop("cars"), traces, strict=True))
    ]
    result["versions"]["onnxruntime"] = onnxruntime
    return EvaluationOutcome(
        **{column.name: getattr(first, column.name) for column in fields(first)},
        **result,
        layout=json.loads(layout),
        rivals=rivals,
        **measured,
    )


def _ways(said: Any, cars: int) -> list[list[int]]:
    """How many steps of each car were answered in each way. Raises ValueError for what is none."""
    ways = [[int(count) for count in car] for car in said]
    if len(ways) != cars or any(len(car) != len(WAYS) for car in ways):
        raise ValueError("not the ways of all cars")
    return ways


def _why(said: dict[str, Any] | None, known: UserFault | None) -> dict[str, Any] | None:
    """Why a car retired, as it is kept: what the runner says, or what we found out about its process at that time."""
    if said is None:
        return None
    fault = known or fault_from_dict(said)
    return {"code": fault.code, "params": fault.params}


def _shares(seconds: dict[str, float], wall_s: float) -> dict[str, float]:
    """Where the wall time went, see :class:`EvaluationOutcome`."""
    parts = {name: seconds[name] for name in ("start", "physics", "camera", "policy")}
    return {**parts, "network": seconds["network"], "other": wall_s - sum(parts.values())}
