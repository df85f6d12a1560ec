"""A golden run driven in two ways: through the pipeline in the sandbox, and in this very process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

from paddock.simulator.engine import ENGINE_ID

from .cars import GoldenCar, car
from .runs import GoldenRun

if TYPE_CHECKING:
    from evaluation.pipeline import CompetitorOutcome, EvaluationOutcome
    from paddock.simulator.race import CompetitorRun, RaceResult


@dataclass(frozen=True)
class DrivenCar:
    """What one car came to. ``ways``: how many of its steps were answered in each of the ways of
    :data:`evaluation.sandbox.policy_wire.WAYS`, which differs from processor to processor and is no part of the
    result."""

    model: str  # its identity
    lap_ms: list[int]  # of complete laps
    end_reason: str
    trace_sha256: str
    ways: list[int] = field(default_factory=list, compare=False)


@dataclass(frozen=True)
class Driven:
    """What a run came to."""

    name: str
    engine: str
    track: str  # its fingerprint
    cars: list[DrivenCar]

    @property
    def traces(self) -> list[str]:
        """The hashes of all cars' traces."""
        return [one.trace_sha256 for one in self.cars]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Driven:
        """What :meth:`to_dict` wrote, also after a way through JSON."""
        return cls(data["name"], data["engine"], data["track"], [DrivenCar(**one) for one in data["cars"]])


def through_the_pipeline(run: GoldenRun) -> Driven:
    """Drive as a worker does: networks and referee in sandboxed processes of their own. Raises PaddockError."""
    from evaluation.pipeline import RaceJob, RivalModel, evaluate

    first, *rivals = cars = [car(name) for name in run.cars]
    track = run.geometry()
    others = tuple(RivalModel(rival.onnx, rival.metadata, rival.facts) for rival in rivals)
    outcome = evaluate(RaceJob(track, run.rules, first.onnx, first.metadata, others, facts=first.facts))
    driven: list[EvaluationOutcome | CompetitorOutcome] = [outcome, *outcome.rivals]
    return Driven(
        run.name,
        outcome.engine,
        track.fingerprint,
        [
            DrivenCar(
                one.sha256,
                [lap["time_ms"] for lap in came.laps if lap["complete"]],
                came.end_reason,
                came.trace_sha256,
                ways,
            )
            for one, came, ways in zip(cars, driven, outcome.ways, strict=True)
        ],
    )


def in_this_process(run: GoldenRun) -> Driven:
    """Drive with simulator and networks in this process, which should have been started with the pins of
    :mod:`paddock.exact`. Raises UserFault."""
    from evaluation.sandbox.policy_wire import EXCEEDED
    from paddock.network.bound import NetworkFacts

    cars = [car(name) for name in run.cars]
    driven = _driven(run, cars)
    if not any(one.ways[EXCEEDED] for one in driven.cars):
        return driven
    # as the pipeline does: once more, with exact answers of those whose bound did not hold
    exact = NetworkFacts(bound=None).to_dict()
    pairs = zip(cars, driven.cars, strict=True)
    return _driven(run, [replace(one, facts=exact) if came.ways[EXCEEDED] else one for one, came in pairs])


def _driven(run: GoldenRun, cars: Sequence[GoldenCar]) -> Driven:
    from paddock.simulator.race import run_race

    policies = [_Here(one) for one in cars]
    first, *rivals = [policy.entrant for policy in policies]
    track = run.geometry()
    result = run_race(
        track,
        run.rules,
        first.action_space,
        first.sensors,
        first.policy,
        rivals=rivals,
        lidar_config=first.lidar_config,
    )
    driven: list[RaceResult | CompetitorRun] = [result, *result.rivals]
    return Driven(
        run.name,
        ENGINE_ID,
        track.fingerprint,
        [
            DrivenCar(
                one.sha256,
                [lap.time_ms for lap in came.laps if lap.complete],
                came.end_reason,
                came.trace.sha256,
                policy.ways,
            )
            for one, came, policy in zip(cars, driven, policies, strict=True)
        ],
    )


class _Here:
    """The policy of a sandboxed process, without the process."""

    def __init__(self, one: GoldenCar) -> None:
        from evaluation.runner_process import policy_header
        from evaluation.sandbox.policy_process import Policy
        from paddock.network.bound import NetworkFacts
        from paddock.network.session import load
        from paddock.simulator.action import ActionSpace
        from paddock.simulator.race import Entrant

        space = ActionSpace.from_metadata(one.metadata)
        self._policy = Policy(load(one.onnx, NetworkFacts.from_dict(one.facts)), policy_header(one.metadata, space))
        sensors = sorted(one.metadata["sensor"])
        self.entrant = Entrant(space, sensors, self._policy.answer, one.metadata.get("lidar_config"))

    @property
    def ways(self) -> list[int]:
        return list(self._policy.counts.values())
