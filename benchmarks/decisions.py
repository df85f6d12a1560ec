"""``python -m benchmarks.decisions``: what it takes that a network decides the same everywhere, step by step.

Reads runs as :mod:`training.golden.bare_process` does, and prints a JSON object for each: of its first car how many
steps were answered in which way, how much of its bound the errors of float32 ever used, and the time of the network's
answers as they race (``judged_s``), of the runtime's alone (``plain_s``), and of all the rest of the run (``rest_s``).
Each step asks both, in turns one first and then the other.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np

from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import PolicyHeader
from paddock.network.session import load
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.sensors import policy_header
from training.golden.bare_process import answer_each
from training.golden.cars import car
from training.golden.runs import GoldenRun


class Asked:
    """A policy that asks the network in three ways: as it races, as the runtime answers, and in float64 always."""

    def __init__(self, name: str) -> None:
        one = car(name)
        self.space = ActionSpace.from_metadata(one.metadata)
        header = policy_header(one.metadata, self.space)
        facts = NetworkFacts.from_dict(one.facts)
        unjudged: PolicyHeader = {"inputs": header["inputs"], "outputs": header["outputs"]}
        self._judged, self._plain = Policy(load(one.onnx, facts), header), Policy(load(one.onnx, facts), unjudged)
        self._exact = Policy(load(one.onnx, NetworkFacts(bound=None)), header)
        self.sensors, self.lidar = sorted(one.metadata["sensor"]), one.metadata.get("lidar_config")
        self.bound = facts.bound
        self.worst = self.judged_s = self.plain_s = self.checking_s = 0.0
        self._turn = False

    @property
    def ways(self) -> list[int]:
        """Steps by the ways of :data:`paddock.network.policy_wire.WAYS`."""
        return list(self._judged.counts.values())

    def __call__(self, readings: Mapping[str, np.ndarray]) -> np.ndarray:
        self._turn = not self._turn  # who asks first finds colder caches
        if self._turn:
            answer, judged_s = _timed(self._judged, readings)
            plain, plain_s = _timed(self._plain, readings)
        else:
            plain, plain_s = _timed(self._plain, readings)
            answer, judged_s = _timed(self._judged, readings)
        self.judged_s += judged_s
        self.plain_s += plain_s
        right, checking_s = _timed(self._exact, readings)
        self.checking_s += checking_s
        self.worst = max(self.worst, float(np.abs(right.astype(np.float64) - plain).max()))
        return answer


def drive(run: GoldenRun) -> dict[str, Any]:
    """The figures of a run's first car, alone on the track."""
    asked = Asked(run.cars[0])
    begun = perf_counter()
    run_race(
        RaceSettings(run.geometry(), run.rules, [Entrant(asked.space, asked.sensors, asked, lidar_config=asked.lidar)])
    )
    rest_s = perf_counter() - begun - asked.judged_s - asked.plain_s - asked.checking_s
    return {
        "name": run.name,
        "ways": asked.ways,
        "bound_used": asked.worst / asked.bound if asked.bound else None,
        "judged_s": asked.judged_s,
        "plain_s": asked.plain_s,
        "rest_s": rest_s,
    }


def _timed(policy: Policy, readings: Mapping[str, np.ndarray]) -> tuple[np.ndarray, float]:
    begun = perf_counter()
    answer = policy.answer(readings)
    return answer, perf_counter() - begun


def main() -> int:
    """Drive what stdin lists; 2 without the pins."""
    return answer_each("benchmarks.decisions", lambda described: drive(GoldenRun.from_dict(described)))


if __name__ == "__main__":
    sys.exit(main())
