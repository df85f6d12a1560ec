"""``python -m benchmarks.deepracer [--json]``: steps a second of ``deepracer-v0`` on one core, without a learner.

As a program of a course makes it: ``gymnasium.make`` with its wrappers, random actions, a new episode after each end.
Steps a second of processor time, so that it can be measured on a machine that does other things. The original's
container takes three cores, a minute to start, and 15 steps a second of real time (its camera's rate): the promise is a
hundred times as many. ``interpreted`` rows draw the pictures without the compiled function, as where no C compiler was
found; there nothing is promised.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")

import gymnasium
import numpy as np

import paddock.deepracer
from paddock.simulator.camera import view
from paddock.simulator.camera.warp import NumpyWarp

from .machine import measured_on
from .report import command, report
from .whole import pin_to_one_core

CONTAINER_HZ = 15.0
TIMES = 100
FRONT, STEREO, LIDAR = "FRONT_FACING_CAMERA", "STEREO_CAMERAS", "LIDAR"
SENSORS = ((STEREO, LIDAR), (STEREO,), (FRONT, LIDAR), (FRONT,))
OBJECTS: Mapping[str, Mapping[str, str]] = {
    "alone": {},
    "6 boxes": {"NUMBER_OF_OBSTACLES": "6", "MIN_DISTANCE_BETWEEN_OBSTACLES": "1.5"},
    "4 bots": {"NUMBER_OF_BOT_CARS": "4", "IS_LANE_CHANGE": "true"},
}
TRACKS = ("reInvent2019_wide", "Spain_track")
RUNS = 3  # of which the fastest counts


def measure(make: Callable[[], gymnasium.Env], steps: int) -> dict[str, float]:
    """Steps and episodes of an environment: the fastest of some runs."""
    env, rng = make(), np.random.default_rng(1)
    count = env.action_space.n  # type: ignore[attr-defined]
    began = time.process_time()
    env.reset(seed=1)
    start_s, best, episodes = time.process_time() - began, 0.0, 0
    for _ in range(RUNS):
        began, episodes = time.process_time(), 0
        for _ in range(steps):
            *_, terminated, truncated, _ = env.step(int(rng.integers(count)))
            if terminated or truncated:
                env.reset()
                episodes += 1
        best = max(best, steps / (time.process_time() - began))
    env.close()
    return {
        "steps_per_s": best,
        "times": best / CONTAINER_HZ,
        "start_s": start_s,
        "steps_per_episode": steps / max(1, episodes),
    }


def rows(steps: int) -> dict[str, dict[str, float]]:
    """The figures by track, objects and sensors."""
    found = {}
    for track in TRACKS:
        for objects, config in OBJECTS.items():
            for sensors in SENSORS:
                found[f"{track}, {objects}, {'+'.join(sensors)}"] = measure(
                    lambda: _made(track, config, sensors),  # noqa: B023
                    steps,
                )
    with mock.patch.object(view, "best_warp", lambda: NumpyWarp):
        for sensors in SENSORS:
            found[f"interpreted, {TRACKS[0]}, alone, {'+'.join(sensors)}"] = measure(
                lambda: _made(TRACKS[0], {}, sensors),  # noqa: B023
                max(100, steps // 10),
            )
    return found


def _made(track: str, config: Mapping[str, str], sensors: tuple[str, ...]) -> gymnasium.Env:
    return gymnasium.make(
        paddock.deepracer.ENV_ID, agent_config={"sensor": list(sensors)}, track_config=config, world_name=track
    )


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [
        f"{machine['cpu']}, load {machine['load_before']} to {machine['load_after']}; one core, processor time",
        "",
    ]
    lines.append(f"{'steps/s':>10}{'times':>8}{'start s':>9}  what")
    for name, one in figures["rows"].items():
        lines.append(f"{one['steps_per_s']:>10.0f}{one['times']:>8.0f}{one['start_s']:>9.2f}  {name}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; 1 where a promise is missed."""
    parser = command("deepracer", "Steps a second of deepracer-v0.")
    parser.add_argument("--steps", type=int, default=3000)
    options = parser.parse_args(arguments)
    load = os.getloadavg()[0]
    pin_to_one_core()
    found = rows(options.steps)
    missed = [
        f"{name}: {one['times']:.0f} times a container's speed, not {TIMES}"
        for name, one in found.items()
        if one["times"] < TIMES and not name.startswith("interpreted")
    ]
    return report({"machine": measured_on(load), "rows": found}, as_json=options.json, table=table, missed=missed)


if __name__ == "__main__":
    sys.exit(main())
