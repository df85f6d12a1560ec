"""Redraws what a car of a finished run saw at a step from its trace, and asks its network for the answer.

The engine's camera draws the frames; no car is simulated. The network answers in a sandboxed policy process, one lap at
a time, and its answers are cached for a day. OpenCV is imported with the first frame.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import TYPE_CHECKING

from django.core.cache import cache

from paddock.errors import PaddockError, UserFault
from paddock.geometry.track import TrackGeometry
from paddock.packages.inputs import CAMERAS
from paddock.simulator.results import LapDocument

from ..models import CompetitorResult, Evaluation, Result, TrainedModel
from ..running.results import read_layout, read_trace
from ..sandbox.claims import default_directory
from ..sandbox.slots import upload_slot
from ..stored_files import read

if TYPE_CHECKING:
    import numpy as np

    from paddock.network.bound import FactsDocument
    from paddock.packages.metadata import MetadataDocument
    from paddock.simulator.action import ActionSpace
    from paddock.simulator.camera.view import Scene
    from paddock.simulator.retracing import RunSight
    from paddock.simulator.sensors import Reading

CAMERA = ("FRONT_FACING_CAMERA",)  # what is drawn for readers that may not know the car's sensors
MAX_STEPS = 1500  # of a lap that are answered: 100 s of driving
KEPT_S = 86_400
_ANSWER_S = 15.0  # of the network's own time for a lap
_STEP_S = 1.0
_WAIT_S = 8.0
_SLOTS, _WAITING = 2, 4
_DIGITS = 4
_drawing = Lock()  # a camera draws into a frame of its own: one thread at a time


@dataclass(frozen=True)
class Moment:
    """A step of a run. ``ms``: simulated, since the run began; ``lap``: from 1; ``steering``, ``speed`` and ``index``:
    the command (degrees, m/s, place in the list or -1). ``asked``: false during a penalty or after the run."""

    step: int
    ms: int
    lap: int
    steering: float
    speed: float
    index: int
    asked: bool


class SeenRun:
    """A car of a finished run, to be looked at. Raises PlatformFault where its files cannot be read."""

    def __init__(self, evaluation: Evaluation, car: CompetitorResult, model: TrainedModel, number: int = 0) -> None:
        self._evaluation, self._car, self._model, self._number = evaluation, car, model, number
        self._sight = _sight(evaluation.pk, number, evaluation.result.trace.name or "")

    @property
    def trace_sha256(self) -> str:
        return self._car.trace_sha256

    @property
    def laps(self) -> list[LapDocument]:
        return self._car.laps

    @property
    def space(self) -> ActionSpace:
        from paddock.simulator.action import ActionSpace

        return ActionSpace.from_metadata(self._model.metadata)

    def start_of(self, lap: int) -> int:
        return next((one["start_ms"] for one in self._car.laps if one["number"] == lap), 0)

    def at(self, ms: int, lap: int | None = None) -> Moment:
        """The last step at or before ``ms``, of the run or since the beginning of ``lap``. Raises UserFault
        ``seen_lap`` for a lap that is not there."""
        path = self._sight.path
        if lap is None:
            steps = range(len(path.ms))
            step = max((step for step in steps if path.ms[step] <= ms), default=0) if steps else None
        else:
            step = path.step_at(lap, self.start_of(lap) + ms)
        if step is None:
            raise UserFault("seen_lap", lap=str(lap), laps=len(self._car.laps))
        return self.moment(step)

    def moment(self, step: int) -> Moment:
        """A step by its number, from 0; the nearest that there is."""
        path = self._sight.path
        step = min(max(step, 0), len(path.ms) - 1)
        return Moment(step, path.ms[step], path.laps[step], *path.actions[step], asked=path.asked[step])

    def readings(self, step: int, sensors: Sequence[str]) -> dict[str, np.ndarray]:
        config = tuple(sorted((self._model.metadata.get("lidar_config") or {}).items()))
        with _drawing:
            return self._sight.readings(step, _readings(*self._venue, tuple(sorted(sensors)), config))

    def picture(self, step: int, sensors: Sequence[str]) -> bytes:
        from .sensor_pictures import Viewpoint, reading_picture

        readings = self.readings(step, sensors)
        view = Viewpoint(*self._sight.path.places[step], self._sight.solids(step))
        return reading_picture(readings, view, self._model.metadata.get("lidar_config"))

    def frames(self, moments: Sequence[int]) -> list[np.ndarray]:
        """What its front camera sees at these moments (ms since its first step), each at the last step at or before
        it."""
        (camera,), first = CAMERA, self._sight.path.ms[0]
        return [self.readings(self.at(first + ms).step, CAMERA)[camera] for ms in moments]

    def answers(self, lap: int, *, racer_pk: int) -> dict[int, list[float]]:
        """The network's outputs at the steps of a lap at which it was asked (the first :data:`MAX_STEPS`), by step.
        ``racer_pk``: the reader. The first call takes a second or two. Raises the faults of a policy process,
        PlatformFault ``upload_busy``."""
        key = f"seen-{self._car.trace_sha256}-{self._model.network_id}-{self._number}-{lap}"
        kept = cache.get(key)
        if kept is not None:
            return {int(step): values for step, values in json.loads(zlib.decompress(kept)).items()}
        path = self._sight.path
        steps = [step for step in path.steps_of(lap) if path.asked[step]][:MAX_STEPS]
        network = self._model.network
        sensors = sorted(self._model.metadata["sensor"])
        before = self._before(steps[0]) if steps else []
        rows = answered(
            read(network.onnx.name or ""),
            self._model.metadata,
            network.facts,
            (self.readings(step, sensors) for step in (*before, *steps)),
            racer_pk=racer_pk,
        )[len(before) :]
        values = {step: [round(value, _DIGITS) for value in row] for step, row in zip(steps, rows, strict=True)}
        cache.set(key, zlib.compress(json.dumps(values).encode()), KEPT_S)
        return values

    def _before(self, step: int) -> list[int]:
        """The steps whose observations a network that stacks them still reads at ``step``, as far as there are any."""
        asked = [one for one in range(step) if self._sight.path.asked[one]]
        return asked[max(0, len(asked) - self._frames + 1) :]

    @property
    def _frames(self) -> int:
        return self._model.metadata.get("frame_stack", 1)

    @property
    def has_camera(self) -> bool:
        return any(name in CAMERAS for name in self._model.metadata["sensor"])

    def attention(self, step: int, *, racer_pk: int) -> bytes:
        """The camera's frame at a step as a PNG, the redder the more a place matters to the network
        (:mod:`.occlusion`). The first call takes a second. Raises what :meth:`answers` raises; ValueError for a car
        without a camera."""
        key = f"attention-{self._car.trace_sha256}-{self._model.network_id}-{self._number}-{step}"
        kept = cache.get(key)
        if kept is not None:
            return kept
        import numpy as np

        from .occlusion import camera_of, covered, heat, heat_picture
        from .sensor_pictures import ZOOM

        sensors = sorted(self._model.metadata["sensor"])
        readings = self.readings(step, sensors)
        camera = camera_of(readings)
        if camera is None:
            raise ValueError("a car without a camera")
        network = self._model.network
        nothing = {name: np.zeros_like(value) for name, value in readings.items()}
        before = [self.readings(one, sensors) for one in self._before(step)]
        before = [nothing] * (self._frames - 1 - len(before)) + before
        asked = (one for shown in covered(readings, camera) for one in (*before, shown))
        rows = answered(read(network.onnx.name or ""), self._model.metadata, network.facts, asked, racer_pk=racer_pk)
        rows = rows[self._frames - 1 :: self._frames]
        shares = probabilities if self.space.kind == "discrete" else _of_their_ranges
        drawn = heat_picture(readings[camera], heat([shares(row) for row in rows], readings[camera]), ZOOM)
        cache.set(key, drawn, KEPT_S)
        return drawn

    @property
    def _venue(self) -> tuple[TrackGeometry, str, str]:
        spec = self._evaluation.spec
        look = spec.get("look", "official")
        return self._evaluation.track.geometry, spec["rules"].get("direction", "ccw"), look


def answered(
    onnx: bytes,
    metadata: MetadataDocument,
    facts: FactsDocument | None,
    readings: Iterator[dict[str, np.ndarray]],
    *,
    racer_pk: int,
) -> list[list[float]]:
    """What a network answers to ``readings``, asked in a sandboxed process of its own: see :meth:`SeenRun.answers`."""
    from paddock.simulator.action import ActionSpace
    from paddock.simulator.sensors import policy_header

    from ..sandbox.policy import PolicyProcess

    header = policy_header(metadata, ActionSpace.from_metadata(metadata))
    slots = default_directory() / "answers"
    with upload_slot(_SLOTS, _WAIT_S, slots, waiting=_WAITING, racer_pk=racer_pk), PolicyProcess() as policy:
        policy.load(onnx, header, facts)
        client = policy.client(header, step_deadline_s=_STEP_S, overage_s=_STEP_S, total_s=_ANSWER_S)
        try:
            return [client(reading).tolist() for reading in readings]
        except PaddockError as fault:
            raise policy.explain(fault) from fault


def probabilities(values: Sequence[float]) -> list[float]:
    """The shares, 1 in all, that a discrete network's output stands for: the softmax of its scores, or the output
    itself where the network ends in one."""
    import numpy as np

    scores = np.array(values, np.float64)
    if (scores >= 0).all() and abs(scores.sum() - 1.0) < 1e-2:
        return (scores / scores.sum()).tolist()
    powers = np.exp(scores - scores.max())
    return (powers / powers.sum()).tolist()


def _of_their_ranges(values: Sequence[float]) -> list[float]:
    """Where the two values of a continuous space lie in their ranges, 0 to 1."""
    return [(min(max(value, -1.0), 1.0) + 1.0) / 2 for value in values]


@lru_cache(maxsize=16)
def _sight(pk: int, number: int, trace: str) -> RunSight:
    """The run as one of its cars saw it. ``trace``: the file, which another result would have another of."""
    from paddock.rules.race import RaceRules
    from paddock.simulator.retracing import RunSight, TracePath, standing_boxes

    # of a sealed run, too: callers check access to its steps
    result = Result.with_sealed.select_related("evaluation__track").prefetch_related("rivals").get(evaluation=pk)
    cars: dict[int, CompetitorResult] = {0: result} | {rival.number: rival for rival in result.rivals.all()}
    paths = {key: TracePath.of(read_trace(car), retired=bool(car.retired_code)) for key, car in sorted(cars.items())}
    layout, rules = read_layout(result), RaceRules.from_dict(result.evaluation.spec["rules"])
    track = result.evaluation.track.geometry.in_direction(rules.direction)
    others = [path for key, path in paths.items() if key != number]
    return RunSight(paths[number], standing_boxes(track, rules, layout["boxes"]), layout["bots"], others)


@lru_cache(maxsize=2)  # that of a large track takes 30 MB
def _scene(track: TrackGeometry, direction: str, look: str) -> Scene:
    from paddock.simulator.camera.theme import THEMES
    from paddock.simulator.camera.view import Scene

    return Scene.of(track.in_direction(direction), THEMES[look])


@lru_cache(maxsize=4)
def _readings(
    track: TrackGeometry, direction: str, look: str, sensors: tuple[str, ...], lidar: tuple[tuple[str, float], ...]
) -> dict[str, Reading]:
    from paddock.simulator.sensors import make_sensors

    return make_sensors(sensors, lambda: _scene(track, direction, look), dict(lidar) or None)


def seen_run(evaluation: Evaluation, number: int = 0) -> SeenRun:
    """Car ``number`` of a finished run. Raises UserFault ``car_number`` where there is none."""
    if number == 0:
        return SeenRun(evaluation, evaluation.result, evaluation.model)
    rival = evaluation.rivals.select_related("model__network", "model__owner").filter(number=number).first()
    driven = evaluation.result.rivals.filter(number=number).first()
    if rival is None or driven is None:
        known = ["0", *(str(one.number) for one in evaluation.rivals.all())]
        raise UserFault("car_number", car=str(number), known=", ".join(known))
    return SeenRun(evaluation, driven, rival.model, number)
