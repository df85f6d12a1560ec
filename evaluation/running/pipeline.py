"""Evaluates models in a race, with a policy process for each model and one runner process."""

import contextlib
import json
import select
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, TypeAlias, cast

from paddock.errors import PaddockError, PlatformFault, UserFault, fault_from_dict
from paddock.geometry.track import TrackGeometry
from paddock.network.bound import FactsDocument, NetworkFacts
from paddock.network.policy_wire import EXCEEDED, WAYS
from paddock.packages.metadata import MetadataDocument
from paddock.rules.race import RaceRules
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.engine import cpu_model
from paddock.simulator.layout import LayoutDocument
from paddock.simulator.results import Fault, LapDocument

from ..sandbox.cores import PATIENCE_S, one_core
from ..sandbox.frames import FrameClosed, FrameError, read_message, write_message
from ..sandbox.policy import describe, failed_start
from ..sandbox.policy_client import OVERAGE_S, STEP_DEADLINE_S, TOTAL_S
from ..sandbox.process import widen_pipe
from .messages import ResultDocument, RetiredDocument, RunnerMessage, RunProgress
from .process_pool import ProcessPool
from .race_setup import Venue, check_rivals

WALL_LIMIT_S = 300.0
_START_S = 30.0
_MESSAGE_S = 10.0  # a runner that began to write a message ends it
_STOP_EVERY_S = 0.25
OnProgress: TypeAlias = Callable[[RunProgress], None]


@dataclass(frozen=True)
class RivalModel:
    """A submitted car, as in :class:`RaceJob`."""

    onnx: bytes
    metadata: MetadataDocument
    facts: FactsDocument | None = None


@dataclass(frozen=True)
class RaceJob:
    """What to evaluate. ``metadata``: the model's checked ``model_metadata.json``; ``onnx``: its canonical bytes;
    ``facts``: of :class:`paddock.network.bound.NetworkFacts`, None if unknown. ``rivals``: cars 1, 2 and 3. ``look``: a
    name of ``paddock.simulator.camera.theme.THEMES``. Raises UserFault (:func:`.race_setup.check_rivals`)."""

    track: TrackGeometry
    rules: RaceRules
    onnx: bytes
    metadata: MetadataDocument
    rivals: tuple[RivalModel, ...] = ()
    look: str = OFFICIAL.name
    facts: FactsDocument | None = None

    def __post_init__(self) -> None:
        check_rivals(self.rules, len(self.rivals))

    @property
    def venue(self) -> Venue:
        return Venue(self.track, self.rules.direction, self.look)

    @property
    def first(self) -> RivalModel:
        return RivalModel(self.onnx, self.metadata, self.facts)


@dataclass(frozen=True)
class PolicyBudget:
    """A model's time, in wall seconds: a step, what all steps together may take above it, and the whole run."""

    step_deadline_s: float = STEP_DEADLINE_S
    overage_s: float = OVERAGE_S
    total_s: float = TOTAL_S


@dataclass(frozen=True, kw_only=True)
class CompetitorOutcome:
    """The outcome of one car. ``trace_csv``: the official sim-trace; ``metrics``: the field's evaluation metrics.
    ``retired``: the fault that took the car off the track while others drove on."""

    laps: list[LapDocument]
    end_reason: str
    retired: Fault | None = None
    trace_csv: bytes
    trace_sha256: str
    metrics: Mapping[str, object]


@dataclass(frozen=True, kw_only=True)
class EvaluationOutcome(CompetitorOutcome):
    """The outcome of an evaluation: that of car 0, and of its ``rivals``. Only ``wall_s``, ``shares`` and ``peak_mb``
    depend on the wall clock, and only these and ``ways`` on the processor.

    ``layout``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}], "bots": [[[x, y, yaw], ... a row], ... a bot]}`` in
    metres and radians. ``order``: the numbers of all cars, winner first. ``simulated_ms``, ``steps``: until the last
    car was done. ``shares``: wall seconds in ``start``, ``physics``, ``camera``, ``policy`` (of which ``network`` on
    the models' CPU clocks) and ``other``. ``peak_mb``: the largest resident sets of all processes added up. ``ways``:
    for each car, its steps by :data:`paddock.network.policy_wire.WAYS`. ``inexact``: cars whose bound did not hold
    (:class:`paddock.network.bound.NetworkFacts`); all was driven again without it.
    """

    simulated_ms: int
    steps: int
    engine: str
    versions: dict[str, str]
    cpu_model: str
    wall_s: float
    shares: dict[str, float]
    peak_mb: float
    layout: LayoutDocument = field(default_factory=lambda: LayoutDocument(boxes=[]))
    order: list[int] = field(default_factory=lambda: [0])
    rivals: list[CompetitorOutcome] = field(default_factory=list)
    ways: list[list[int]] = field(default_factory=list)
    inexact: list[int] = field(default_factory=list)


def evaluate(
    job: RaceJob,
    on_progress: OnProgress | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    wall_limit_s: float = WALL_LIMIT_S,
    *,
    budget: PolicyBudget | None = None,
    level: int | None = None,
    pool: ProcessPool | None = None,
) -> EvaluationOutcome:
    """Run the job in the sandbox. Whatever happens, no process, descriptor or file is left when it returns.

    ``should_stop`` is called about four times a second; what it and ``on_progress`` raise passes through.
    ``wall_limit_s``, for each car, protects the platform from its own simulator: a model's slowness is judged by
    ``budget``, which must be smaller. ``level``: as for :func:`evaluation.sandbox.launch.launch`. ``pool``: processes
    that are kept ready, used up instead of new ones.

    Raises UserFault: ``policy_late``, ``policy_died``, ``policy_memory``, ``policy_protocol``, ``policy_refused``,
    ``non_finite_action`` (these only of a car that is alone; one with rivals retires instead), ``stopped``, and the
    simulator's faults of the model or the layout. Raises PlatformFault: ``sandbox_unavailable``,
    ``sandbox_failed``, ``host_overloaded``, ``runner_timeout``, ``runner_died``, ``runner_protocol``,
    ``runner_error``; notes on it (``__notes__``) carry what the processes wrote to stderr, for operators.
    """
    outcome = _evaluate(job, on_progress, should_stop, wall_limit_s, budget or PolicyBudget(), level, pool)
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
    on_progress: OnProgress | None,
    should_stop: Callable[[], bool],
    wall_limit_s: float,
    budget: PolicyBudget,
    level: int | None,
    pool: ProcessPool | None,
) -> EvaluationOutcome:
    started = time.monotonic()
    cars = 1 + len(job.rivals)
    with pool or ProcessPool(cars, level) as used:
        used.enlist(cars)
        used.runner.allow(wall_limit_s * cars)
        run = SandboxedRun(used, on_progress, should_stop)
        question = {**used.described(job.venue), "rules": job.rules.to_dict(), "budget": asdict(budget)}
        onnxruntime = run.prepare([job.first, *job.rivals], question)
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
    """One job of :func:`evaluate`, or of :func:`evaluation.running.drives.drive_all`. ``processes``: the runner and the
    policies by the names that operators read. ``retired``: the faults of retired cars by number."""

    def __init__(
        self,
        pool: ProcessPool,
        on_progress: OnProgress | None,
        should_stop: Callable[[], bool],
    ) -> None:
        self._pool, self._policies, self._runner = pool, pool.policies, pool.runner
        self._on_progress, self._should_stop = on_progress, should_stop
        self._network_from = [0.0] * len(pool.policies)
        self._network_s = [0.0] * len(pool.policies)
        self.retired: dict[int, UserFault] = {}
        names = ["policy", *(f"policy of car {number}" for number in range(1, len(pool.policies)))]
        self.processes = {"runner": pool.runner}
        self.processes |= {name: policy.process for name, policy in zip(names, pool.policies, strict=True)}

    def prepare(self, cars: Sequence[RivalModel], message: Mapping[str, object]) -> str:
        """Send the job's ``message`` to the runner and the networks to the policies. Returns the version of
        onnxruntime."""
        deadline = time.monotonic() + _START_S
        widen_pipe(self._runner.stdin)
        try:
            write_message(
                self._runner.stdin, {**message, "metadata": [car.metadata for car in cars]}, deadline=deadline
            )
            for number, car in enumerate(cars):
                with self._retiring(number):
                    self._policies[number].give(car.onnx, car.facts)
            answer, _ = read_message(self._runner.stdout, max(deadline, time.monotonic() + _MESSAGE_S))
        except FrameError as error:
            raise failed_start(self._runner, str(error)) from None
        self._raise_error(cast(RunnerMessage, answer))
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

    def drive(self) -> tuple[RunnerMessage, list[bytes]]:
        """Start the race and follow it to its end. Returns the last message and its blobs."""
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
            message, blobs = self._read_message()
            self._raise_error(message)
            if "result" in message:
                return message, blobs
            if "retired" in message:
                self._note_retired(message["retired"])
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
        """Attach the stderr of the processes, which operators may read and racers may not."""
        for name, process in self.processes.items():
            if text := process.stderr_text().strip():
                fault.add_note(f"stderr of the {name}:\n{text}")
        return fault

    def check_stop(self) -> None:
        if self._should_stop():
            raise UserFault("stopped")

    @contextlib.contextmanager
    def _retiring(self, number: int) -> Iterator[None]:
        """A car with rivals that fails at the start retires; a single car's fault propagates."""
        try:
            yield
        except UserFault as fault:
            if len(self._policies) == 1:
                raise
            self._retire(number, fault)

    def _note_retired(self, report: RetiredDocument) -> None:
        """Retire a car whose policy the runner found at fault, explained now: later it might look otherwise."""
        try:
            number, fault = report["car"], fault_from_dict(report["error"])
            policy = self._policies[number]
        except (KeyError, TypeError, ValueError, IndexError):
            raise self.noted(PlatformFault("runner_protocol")) from None
        if number not in self.retired:
            explained = policy.explain(fault)
            if not isinstance(explained, UserFault):
                raise self.noted(explained)
            self._retire(number, explained)

    def _retire(self, number: int, fault: UserFault) -> None:
        """Note the fault, and end the process: it would take the others' processor."""
        self.retired[number] = fault
        self._note_network(number)
        self._policies[number].process.peak_mb()
        self._policies[number].process.kill()

    def _note_network(self, number: int) -> None:
        used = self._policies[number].process.cpu_seconds() - self._network_from[number]
        self._network_s[number] = max(self._network_s[number], used)

    def _read_message(self) -> tuple[RunnerMessage, list[bytes]]:
        try:
            message, blobs = read_message(self._runner.stdout, time.monotonic() + _MESSAGE_S)
            return cast(RunnerMessage, message), blobs
        except FrameClosed:
            how = describe(self._runner.wait(1.0))
            raise self.noted(PlatformFault("runner_died", how=how)) from None
        except FrameError:
            raise self.noted(PlatformFault("runner_protocol")) from None

    def _raise_error(self, message: RunnerMessage) -> None:
        if "error" not in message:
            return
        try:
            fault = fault_from_dict(message["error"])
        except (KeyError, TypeError, ValueError):
            raise self.noted(PlatformFault("runner_protocol")) from None
        raise self.noted(self._policies[0].explain(fault))


def _outcome(
    result: ResultDocument, blobs: list[bytes], retired: dict[int, UserFault], onnxruntime: str, **measured: Any
) -> EvaluationOutcome:
    """The outcome in the runner's last message. Raises KeyError, TypeError, ValueError or IndexError if malformed."""
    layout, *traces = blobs
    cars = [
        CompetitorOutcome(
            laps=car["laps"],
            end_reason=car["end_reason"],
            retired=_why(car["retired"], retired.get(number)),
            trace_csv=trace,
            trace_sha256=car["trace_sha256"],
            metrics=car["metrics"],
        )
        for number, (car, trace) in enumerate(zip(result["cars"], traces, strict=True))
    ]
    return EvaluationOutcome(
        **vars(cars[0]),
        order=result["order"],
        simulated_ms=result["simulated_ms"],
        steps=result["steps"],
        engine=result["engine"],
        versions={**result["versions"], "onnxruntime": onnxruntime},
        layout=json.loads(layout),
        rivals=cars[1:],
        **measured,
    )


def _ways(counts: Any, cars: int) -> list[list[int]]:
    """How many steps of each car were answered in each way. Raises ValueError for what is none."""
    ways = [[int(count) for count in car] for car in counts]
    if len(ways) != cars or any(len(car) != len(WAYS) for car in ways):
        raise ValueError("not the ways of all cars")
    return ways


def _why(error: Fault | None, known: UserFault | None) -> Fault | None:
    """Why a car retired, as stored: the fault ``known`` from its process, or else the ``error`` of the runner."""
    if error is None:
        return None
    fault = known or fault_from_dict(error)
    return {"code": fault.code, "params": fault.params}


def _shares(seconds: dict[str, float], wall_s: float) -> dict[str, float]:
    parts = {name: seconds[name] for name in ("start", "physics", "camera", "policy")}
    return {**parts, "network": seconds["network"], "other": wall_s - sum(parts.values())}
