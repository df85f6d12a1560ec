"""A golden run driven in two ways: through the pipeline in the sandbox, and in this very process."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from paddock.simulator.engine import ENGINE_ID

from .cars import car
from .runs import GoldenRun

if TYPE_CHECKING:
    from evaluation.pipeline import CompetitorOutcome, EvaluationOutcome


@dataclass(frozen=True)
class DrivenCar:
    """What one car came to. ``ways``: how many of its steps were answered in each of the ways of
    :data:`paddock.network.policy_wire.WAYS`, which differs from processor to processor and is no part of the
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
    from paddock.packages.own import OwnCar
    from paddock.simulator.own import drive

    cars = [car(name) for name in run.cars]
    track = run.geometry()
    own = drive(track, run.rules, [OwnCar(one.onnx, one.metadata, one.facts, one.sha256) for one in cars])
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
                ways,
            )
            for one, came, ways in zip(cars, own.cars, own.ways, strict=True)
        ],
    )
