"""What a training is, as plain values that cross a pipe as JSON."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from paddock.simulator.camera.theme import OFFICIAL

from .network import OURS

PROGRESS, REWARD, LAP_TIME = "progress", "reward", "lap_time"
CARS = 16  # that drive at the same time
EPISODE_STEPS = 100  # what one episode counts for when the steps between two updates are reckoned


@dataclass(frozen=True)
class TrainerSpec:
    """All that a training depends on. ``track``: ``TrackGeometry.to_dict()`` in the driven direction.

    ``look``: what cameras see of it, a name of ``paddock.simulator.camera.theme.THEMES``.

    ``layout``: the keyword arguments of the race type's environment (boxes, bots). ``metadata``: the checked
    ``model_metadata.json`` of the model to be made. ``hyperparameters``: checked, see :mod:`training.hyperparameters`.
    ``build``: how the network is built, a name of :data:`.network.BUILDS`.
    ``reward_code``: the source of the reward function; ``""`` is the console's default, which needs no stranger's code.

    ``more_tracks``: others beside it, ``{"track", "look"}`` each. Every episode drives on one of them all, drawn from
    the seed; with ``alternate_direction`` a car's every second episode goes the other way. Evaluations drive each of
    these ways (:attr:`ways`). ``randomise``: strengths of what episodes draw about the world, see
    :class:`paddock.simulator.randomisation.Randomisation`; evaluations are without.

    It stops at the first of: ``stop_seconds`` of wall time (those of earlier attempts, ``seconds_before``, count),
    ``stop_steps`` control steps, and ``stop_clean_laps`` laps in a row without a fault from the finish line,
    on each way.
    ``iterations_before``: of earlier attempts, up to the checkpoint that this one goes on from.
    """

    track: dict[str, Any]
    race_type: str
    metadata: dict[str, Any]
    algorithm: str
    hyperparameters: dict[str, Any]
    reward_code: str = ""
    layout: dict[str, Any] = field(default_factory=dict)
    stop_seconds: float = 600.0
    stop_steps: int | None = None
    stop_clean_laps: int | None = None
    trials: int = 3
    best_metric: str = PROGRESS
    seed: int = 0
    seconds_before: float = 0.0
    iterations_before: int = 0
    look: str = OFFICIAL.name
    build: str = OURS
    more_tracks: list[dict[str, Any]] = field(default_factory=list)
    alternate_direction: bool = False
    randomise: dict[str, float] = field(default_factory=dict)

    @property
    def ways(self) -> int:
        """Tracks, times the directions of each."""
        return (1 + len(self.more_tracks)) * (2 if self.alternate_direction else 1)

    @property
    def trials_driven(self) -> int:
        """Trials of an evaluation: ``trials``, and at least one on each way."""
        return max(self.trials, self.ways)

    @property
    def updates_a_look(self) -> int:
        """After so many updates the car is looked at: trials on many ways take their time, and driving shall have as
        large a share of it as on one."""
        return -(-self.trials_driven // self.trials)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> TrainerSpec:
        """The inverse of :meth:`to_dict`. Raises TypeError for an unknown key."""
        return cls(**data)

    @property
    def warmth(self) -> dict[str, Any]:
        """What the process must know before its lock (:mod:`.warm`): our own numbers, nothing of a stranger.

        ``learned`` and ``driven``: the sizes of the batches.
        """
        batch = self.hyperparameters["batch_size"]
        ppo = self.algorithm == "ppo"
        driven = {CARS * self.steps_each, CARS * self.rollout_steps(self._full_rollouts)}
        keys = ("sensor", "lidar_config", "neural_network", "action_space_type", "action_space")
        return {
            "metadata": {key: self.metadata[key] for key in keys if key in self.metadata},
            "build": self.build,
            "learned": sorted({batch, *(count % batch or batch for count in driven)} if ppo else {batch}),
            "driven": [*range(1, self.trials_driven + 1), CARS],
        }

    @property
    def steps_each(self) -> int:
        """Control steps of each car between two updates: the field counts episodes (5 to 100), stable-baselines3 steps.
        An episode counts :data:`EPISODE_STEPS`, so 100 of them are the field's own cap of 10,000 steps an update."""
        return -(-self.hyperparameters["num_episodes_between_training"] * EPISODE_STEPS // CARS)

    def rollout_steps(self, done: int) -> int:
        """Control steps of each car until the next update, when all of them have driven ``done``: ``stop_steps`` cuts
        the last of these short, so that everything that is driven is learned from."""
        if self.stop_steps is None or self.stop_steps <= done:
            return self.steps_each
        return min(self.steps_each, -(-(self.stop_steps - done) // CARS))

    @property
    def _full_rollouts(self) -> int:
        """Steps of all cars before the rollout that ``stop_steps`` cuts short."""
        each = CARS * self.steps_each
        return 0 if self.stop_steps is None else self.stop_steps // each * each
