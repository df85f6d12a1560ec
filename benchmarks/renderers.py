"""The same loop with the warped camera, with six boxes before it, and with Bullet's own TinyRenderer at the same
160 x 120 pixels.

A scripted pilot drives, so that both loops see the same places; each frame goes through the network all the same. No
sandbox: only the ratio of the two counts.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import PolicyInput
from paddock.network.session import load
from paddock.rules.race import OBJECT_AVOIDANCE, RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.camera.optics import Optics
from paddock.simulator.camera.view import Camera
from paddock.simulator.car import Pose
from paddock.simulator.deciding import Policy
from paddock.simulator.layout import lay_out
from paddock.simulator.physics import STEP_MS
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.sensors import POSE, sensor_spec
from paddock.simulator.solids import Solid, box
from paddock.simulator.stage import PreparedTrack, Simulation
from tests.paddock.simulator.tiny_scene import OVERSAMPLING, TinyScene

from .models import AdmittedCar

BOXES = 6

Look = Callable[[Pose, Sequence[Solid]], np.ndarray]
Solids = Callable[[Pose], Sequence[Solid]]
_FULL = Optics()
_SMALL = Optics(columns=_FULL.columns // OVERSAMPLING, rows=_FULL.rows // OVERSAMPLING)


def compare(car: AdmittedCar, track: TrackGeometry, *, steps: int) -> dict[str, Any]:
    """Real-time factors of the loops over ``steps`` control steps, milliseconds a frame, and the ratio.

    ``six_boxes``: as they stand on the track in a race. ``six_in_view``: a row of six that goes before the car.
    """
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        ground = PreparedTrack(track)
        camera = Camera(ground.scene)
        warped = _drive(car, ground, camera.render, steps)
        rules = RaceRules(race_type=OBJECT_AVOIDANCE, random_boxes=BOXES)
        boxes = tuple(placed.solid for placed in lay_out(ground.track, rules).boxes)
        six_boxes = _drive(car, ground, camera.render, steps, lambda pose: boxes)
        six_in_view = _drive(car, ground, camera.render, steps, _row_before)
        scene = TinyScene(track, ground.theme)
        try:
            tiny = _drive(car, ground, lambda pose, _: scene.render(pose, _SMALL), steps)
        finally:
            scene.close()
    finally:
        os.sched_setaffinity(0, before)
    return {
        "model": car.name,
        "warped": warped,
        "six_boxes": six_boxes,
        "six_in_view": six_in_view,
        "tiny_renderer": tiny,
        "ratio": warped["real_time_factor"] / tiny["real_time_factor"],
        "frame_ratio": tiny["frame_ms"] / warped["frame_ms"],
    }


def _row_before(pose: Pose) -> Sequence[Solid]:
    """Six boxes in view of a car, nearer and farther, left and right of its way."""
    return tuple(
        box(*pose.ahead(0.6 + 0.4 * number, 0.3 if number % 2 else -0.3), pose.yaw + 0.2 * number)
        for number in range(BOXES)
    )


def _drive(
    car: AdmittedCar, ground: PreparedTrack, look: Look, steps: int, solids: Solids = lambda pose: ()
) -> dict[str, float]:
    """``frame_ms`` is processor time, the same as wall time on an idle machine."""
    pilot = CentreLinePilot(ground.track, ground.track.direction)
    network = _network(car)
    looking = 0.0
    with Simulation(ground, RaceRules(laps=1000, max_simulated_ms=10_000_000)) as stage:
        competitor = stage.add([POSE])
        started = time.perf_counter()
        for _ in range(steps):
            pose = competitor.car.pose
            before_it = solids(pose)
            before = time.thread_time()
            frame = look(pose, before_it)
            looking += time.thread_time() - before
            network(frame)
            stage.step((pilot.action_space.decode(pilot(competitor.observe())),))
        wall_s = time.perf_counter() - started
    return {"real_time_factor": steps * STEP_MS / 1000.0 / wall_s, "frame_ms": 1000.0 * looking / steps}


def _network(car: AdmittedCar) -> Callable[[np.ndarray], object]:
    """The policy process's own loop body, in this process."""
    specs = [sensor_spec(name) for name in sorted(car.metadata["sensor"])]
    space = ActionSpace.from_metadata(car.metadata)
    inputs: list[PolicyInput] = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
    policy = Policy(
        load(car.onnx, NetworkFacts.from_dict(car.facts)),
        {"inputs": inputs, "outputs": space.size, "ranges": space.ranges},
    )
    (sensor,) = specs
    return lambda frame: policy.answer({sensor.name: frame.reshape(sensor.shape)})
