"""``python -m benchmarks.steps [--json]``: where a control step goes, also on a machine that does other things.

Referee and network as they race, the network in its sandbox, both on one core; each step is timed by itself, and the
figures are means over the fastest fifth of the steps: those that nobody else took the core from. Microseconds:
``physics`` (Bullet), ``camera``, ``network`` (processor time of the model's process), ``exchange`` (what asking it
takes besides), ``rest`` (all else of the step). ``own`` is the share of the last two. What is done once at the end of a
run is not in it; for that see ``python -m benchmarks.evaluation --shares`` on an idle machine.
"""

from __future__ import annotations

import os
import sys
from time import perf_counter
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from evaluation.running.runner_process import policy_of
from evaluation.sandbox.policy import PolicyProcess
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules
from paddock.simulator import race
from paddock.simulator.action import ActionSpace
from paddock.simulator.race import Entrant, RaceSettings
from paddock.simulator.sensors import policy_header

from .machine import measured_on
from .models import CONSOLE, AdmittedCar, admitted, cars
from .report import command, report
from .whole import pin_to_one_core

FASTEST = 5  # one of so many
WARM = 50  # steps until everything was done once
PARTS = ("step", "physics", "camera", "network", "exchange", "rest")


class _Watch:
    """Times each step of the races that are driven while it is there."""

    def __init__(self, policy_pid: int | None) -> None:
        self.steps: list[tuple[float, ...]] = []
        self._clock = os.open(f"/proc/{policy_pid}/schedstat", os.O_RDONLY)

    def __enter__(self) -> _Watch:
        self._step = original = race._Race.step_alone

        def step(one: race._Race) -> None:
            before = self._clocks(one)
            begun = perf_counter()
            original(one)
            took = perf_counter() - begun
            self.steps.append((took, *(now - then for now, then in zip(self._clocks(one), before, strict=True))))

        race._Race.step_alone = step  # type: ignore[assignment, method-assign]
        return self

    def __exit__(self, *_exc: object) -> None:
        race._Race.step_alone = self._step  # type: ignore[method-assign]
        os.close(self._clock)

    def _clocks(self, one: race._Race) -> tuple[float, ...]:
        network_s = int(os.pread(self._clock, 64, 0).split()[0]) / 1e9  # exact, as it waits now
        return one._stage.world.seconds, one.camera_s, network_s, one.policy_s


def measure(car: AdmittedCar, track: TrackGeometry, *, laps: int, runs: int) -> dict[str, Any]:
    """The figures of one car as JSON values."""
    space = ActionSpace.from_metadata(car.metadata)
    header, steps = policy_header(car.metadata, space), []
    for _ in range(runs):
        with PolicyProcess() as policy:
            policy.load(car.onnx, header, car.facts)
            client = policy.client(header)
            sensors, ask = sorted(car.metadata["sensor"]), policy_of(client, space)
            with _Watch(policy.process.inner_pid) as watch:
                race.run_race(
                    RaceSettings(
                        track, RaceRules(laps=laps), [Entrant(space, sensors, ask, places=client.places, asked=client)]
                    )
                )
            steps += watch.steps[WARM:]
    took, physics, camera, network, policy_s = 1e6 * np.array([step for step in steps if step[-1] > 0.0]).T
    parts = took, physics, camera, network, policy_s - network, took - physics - camera - policy_s
    fast = np.argsort(took)[: max(1, len(took) // FASTEST)]
    figures = {name: float(values[fast].mean()) for name, values in zip(PARTS, parts, strict=True)}
    return {**figures, "own": (figures["exchange"] + figures["rest"]) / figures["step"], "steps": len(took)}


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [f"{machine['cpu']}, load {machine['load_before']} to {machine['load_after']}; us of the fastest fifth", ""]
    lines.append(f"{'':10}" + "".join(f"{name:>10}" for name in PARTS) + f"{'own':>8}")
    for name, one in figures["cars"].items():
        lines.append(f"{name:10}" + "".join(f"{one[part]:>10.1f}" for part in PARTS) + f"{one['own']:>8.1%}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = command("steps", "Where a control step goes.")
    parser.add_argument("--track", default="kuei-raceway", choices=[entry.slug for entry in CATALOGUE])
    parser.add_argument("--laps", type=int, default=3)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--models", nargs="+", metavar="NAME", default=[CONSOLE, "brisk"])
    options = parser.parse_args(arguments)
    track = next(entry for entry in CATALOGUE if entry.slug == options.track).geometry()
    load = os.getloadavg()[0]
    pin_to_one_core()
    found = {
        car.name: measure(admitted(car), track, laps=options.laps, runs=options.runs)
        for car in cars()
        if car.name in options.models
    }
    return report({"machine": measured_on(load), "cars": found}, as_json=options.json, table=table)


if __name__ == "__main__":
    sys.exit(main())
