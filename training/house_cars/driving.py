"""Driving a network in this process, for the looks that training takes at its own progress."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import onnxruntime

from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.race import run_race

from .environment import SENSOR


class OnnxDriver:
    """A network as a policy for :func:`paddock.simulator.race.run_race`: one thread, float32, no sandbox."""

    def __init__(self, onnx: bytes) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(onnx, options, providers=["CPUExecutionProvider"])

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        """The network's row of outputs for one frame, uint8 (120, 160, 1)."""
        frame = readings[SENSOR].astype(np.float32).reshape(1, 1, 120, 160)
        return self._session.run(None, {SENSOR: frame})[0]


@dataclass(frozen=True)
class Score:
    """How a network drove one lap of each route, stopped at its first fault. Greater is better."""

    clean: int  # routes finished without a fault
    speed: float  # mean over all routes, m/s; a route not finished counts nothing
    distance: float  # mean share of the lap that was driven

    @property
    def key(self) -> tuple[float, float]:
        """Clean routes first; then speed where they are equal, and distance before any is clean."""
        return (self.clean + self.distance / 100.0 if not self.clean else float(self.clean), self.speed)


def score(onnx: bytes, metadata: dict[str, Any], routes: Sequence[tuple[str, str]]) -> Score:
    """Drive one lap from a standing start on each (slug, direction)."""
    space = ActionSpace.from_metadata(metadata)
    driver = OnnxDriver(onnx)
    clean, speed, distance = 0, 0.0, 0.0
    for slug, direction in routes:
        track = by_slug(slug).geometry()
        rules = RaceRules.of_an_episode(max_simulated_ms=120_000, direction=direction)
        lap = run_race(track, rules, space, [SENSOR], driver).laps[0]
        distance += lap.completion_percentage / 100.0
        if lap.complete:
            clean += 1
            speed += track.length / (lap.time_ms / 1000.0)
    return Score(clean, speed / len(routes), distance / len(routes))
