"""Drives a golden run: through the sandboxed pipeline, or in this process."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from paddock.simulator.engine import ENGINE_ID

from .cars import car
from .runs import GoldenRun


@dataclass(frozen=True)
class DrivenCar:
    """The result of one car. ``ways``: its steps by the ways of :data:`paddock.network.policy_wire.WAYS`, which differ
    between processors and are no part of the result."""

    model: str  # its identity
    lap_ms: list[int]  # of complete laps
    end_reason: str
    trace_sha256: str
    ways: list[int] = field(default_factory=list, compare=False)


@dataclass(frozen=True)
class Driven:
    """The result of a run."""

    name: str
    engine: str
    track: str  # its fingerprint
    cars: list[DrivenCar]

    @property
    def traces(self) -> list[str]:
        return [one.trace_sha256 for one in self.cars]

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Driven":
        """The inverse of :func:`dataclasses.asdict`."""
        return cls(data["name"], data["engine"], data["track"], [DrivenCar(**one) for one in data["cars"]])


def through_the_pipeline(run: GoldenRun) -> Driven:
    """Drive as a worker does: networks and referee in separate sandboxed processes. Raises PaddockError."""
    from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome, RaceJob, RivalModel, evaluate

    first, *rivals = [car(name) for name in run.cars]
    others = tuple(RivalModel(rival.onnx, rival.metadata, rival.facts) for rival in rivals)
    outcome = evaluate(RaceJob(run.geometry(), run.rules, first.onnx, first.metadata, others, facts=first.facts))
    driven: list[EvaluationOutcome | CompetitorOutcome] = [outcome, *outcome.rivals]
    results = [
        ([lap["time_ms"] for lap in came.laps if lap["complete"]], came.end_reason, came.trace_sha256)
        for came in driven
    ]
    return _driven(run, outcome.engine, results, outcome.ways)


def in_this_process(run: GoldenRun) -> Driven:
    """Drive with simulator and networks in this process, which should have been started with the pins of
    :mod:`paddock.exact`. Raises UserFault."""
    from paddock.simulator.own import drive

    own = drive(run.geometry(), run.rules, [car(name) for name in run.cars])
    results = [
        ([lap.time_ms for lap in came.laps if lap.complete], came.end_reason, came.trace.sha256) for came in own.cars
    ]
    return _driven(run, ENGINE_ID, results, own.ways)


def _driven(
    run: GoldenRun, engine: str, results: Sequence[tuple[list[int], str, str]], ways: Sequence[list[int]]
) -> Driven:
    cars = [
        DrivenCar(car(name).sha256, *result, way) for name, result, way in zip(run.cars, results, ways, strict=True)
    ]
    return Driven(run.name, engine, run.geometry().fingerprint, cars)
