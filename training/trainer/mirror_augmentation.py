"""Data augmentation by mirroring: the picture flipped, the steering negated.

A car learns more from the same driving if the mirrored car would have earned the same reward. :meth:`Mirror.of` checks
camera, car and action space; :class:`Twin` computes one car's rewards also for the mirrored car on the mirrored track.
After the first difference the training uses the driven steps only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from paddock.errors import PaddockError
from paddock.rules.hyperparameters import PPO
from paddock.simulator.action import CONTINUOUS, ActionSpace
from paddock.simulator.rewards import Params, RewardFunction
from training.rewards.sandbox.call_limits import watch

from .network import NetworkLayout
from .road_state import MIRRORED
from .spec import TrainerSpec

if TYPE_CHECKING:
    import torch

# Cameras in the middle of the car. A lidar's sectors and a pair of cameras would have to be turned round by themselves.
_IN_THE_MIDDLE = ("FRONT_FACING_CAMERA", "observation")
_NEAR = 1e-6  # of two rewards that are the same


class Mirror:
    """Turns rows and actions round. ``holds``: whether rewards were equal so far."""

    def __init__(self, shape: tuple[int, ...], partners: list[int] | None) -> None:
        """``shape``: of a row's picture. ``partners``: the number of each action's opposite in the list; None for
        steering and speed as numbers."""
        self.holds = True
        self._shape, self._partners = shape, None if partners is None else np.array(partners)

    @classmethod
    def of(cls, spec: TrainerSpec, layout: NetworkLayout) -> Mirror | None:
        """None where a mirrored car would be another one: a camera beside the middle, an action without its opposite;
        and for SAC, which learns more slowly with it."""
        if spec.algorithm != PPO or len(layout.senses) > 1 or layout.senses[0].name not in _IN_THE_MIDDLE:
            return None
        space = ActionSpace.from_metadata(spec.metadata)
        if space.kind == CONTINUOUS:
            low, high = space.steering
            return cls(layout.senses[0].shape, None) if low == -high else None
        actions = [tuple(action) for action in space.actions]
        opposite = [(-steering, speed) for steering, speed in actions]
        if len(set(actions)) < len(actions) or set(opposite) != set(actions):
            return None
        return cls(layout.senses[0].shape, [actions.index(one) for one in opposite])

    def rows(self, rows: torch.Tensor) -> torch.Tensor:
        """``rows``: with or without the state of the road."""
        import torch

        pixels = math.prod(self._shape)
        seen = rows[:, :pixels].reshape(-1, *self._shape).flip(-1).reshape(-1, pixels)
        return torch.cat([seen, rows[:, pixels:] * torch.from_numpy(MIRRORED)], 1) if rows.shape[1] > pixels else seen

    def actions(self, actions: torch.Tensor) -> torch.Tensor:
        """The actions of mirrored cars: numbers of a list (n,) or (n, 1), or steering and speed (n, 2)."""
        import torch

        if self._partners is not None:
            return torch.from_numpy(self._partners)[actions.long()].to(actions.dtype)
        return actions * torch.tensor([-1.0, 1.0], dtype=actions.dtype)


class Twin:
    """The reward function of one car, also called for the mirrored car."""

    def __init__(self, function: RewardFunction, twin: RewardFunction, mirror: Mirror) -> None:
        """``twin``: a second instance of the function with its own state."""
        self._function, self._twin, self._mirror = function, twin, mirror
        self._waypoints: list[tuple[float, float]] = []
        self._mirrored: list[tuple[float, float]] = []

    def __call__(self, params: Params) -> float:
        """The car's reward. Raises what the function raises; what its twin raises is a difference."""
        reward = self._function(params)
        if self._mirror.holds:
            other = self._asked(self._turned(params))
            self._mirror.holds = other is not None and abs(other - reward) <= _NEAR * max(1.0, abs(reward))
        return reward

    def _asked(self, params: Params) -> float | None:
        watch.muted = True  # what it prints is printed once
        try:
            return self._twin(params)
        except PaddockError:
            return None
        finally:
            watch.muted = False

    def _turned(self, params: Params) -> Params:
        if params["waypoints"] is not self._waypoints:
            self._waypoints = params["waypoints"]
            self._mirrored = [(x, -y) for x, y in self._waypoints]
        beside = params["distance_from_center"] > 0.0
        turned: dict[str, object] = {
            "y": -params["y"],
            "heading": -params["heading"],
            "steering_angle": -params["steering_angle"],
            "is_left_of_center": beside and not params["is_left_of_center"],
            "waypoints": self._mirrored,
            "objects_location": [(x, -y) for x, y in params["objects_location"]],
            "objects_left_of_center": [not left for left in params["objects_left_of_center"]],
            "objects_heading": [-heading for heading in params["objects_heading"]],
        }
        return {**params, **turned}
