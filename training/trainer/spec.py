"""The specification of a training as plain values that cross a pipe as JSON."""

from dataclasses import dataclass, field
from typing import Any, TypedDict

from paddock.geometry.track import TrackDocument
from paddock.packages.metadata import MetadataDocument
from paddock.rules.race import TIME_TRIAL
from paddock.simulator.camera.theme import OFFICIAL

from .network import OURS

PROGRESS, REWARD, LAP_TIME = "progress", "reward", "lap_time"
CARS = 16  # that drive at the same time
EPISODE_STEPS = 100  # what one episode counts for when the steps between two updates are reckoned


class TrackAndLook(TypedDict):
    """A further track of a training, as :attr:`TrainerSpec.track` and ``look``."""

    track: TrackDocument
    look: str


class Hyperparameters(TypedDict, total=False):
    """The checked hyperparameters of one algorithm (:mod:`paddock.rules.hyperparameters`)."""

    batch_size: int
    num_epochs: int
    lr: float
    beta_entropy: float
    sac_alpha: float
    entropy_decay: float
    discount_factor: float
    num_episodes_between_training: int
    loss_type: str


class Warmth(TypedDict):
    """The numbers that the process needs before its lock (:mod:`.warm_up`); none is a racer's input. ``learned`` and
    ``driven``: the sizes of the batches."""

    metadata: MetadataDocument
    build: str
    learned: list[int]
    driven: list[int]


@dataclass(frozen=True)
class TrainerSpec:
    """The input of a training. ``track``: ``TrackGeometry.to_dict()`` in the driven direction; ``look``: a name of
    ``paddock.simulator.camera.theme.THEMES``.

    ``layout``: the keyword arguments of the race type's environment (boxes, bots). ``metadata``: the checked
    ``model_metadata.json`` of the model to be made.
    ``build``: how the network is built, a name of :data:`.network.BUILDS`.
    ``reward_code``: the source of the reward function; ``""`` is the console's default, which is our own code.

    ``more_tracks``: further tracks. Every episode drives on one of all tracks, drawn from the seed; with
    ``alternate_direction`` a car's every second episode goes the other way. Evaluations drive each of these ways
    (:attr:`ways`). ``randomise``: strengths of the episodes' random changes of the world, see
    :class:`paddock.simulator.randomisation.Randomisation`; evaluations are without.

    It stops at the first of: ``stop_seconds`` of wall time (with ``seconds_before`` of earlier attempts),
    ``stop_steps`` control steps, and ``stop_clean_laps`` laps in a row without a fault from the finish line, on each
    way. ``iterations_before``: of earlier attempts, up to the checkpoint. ``continues``: another training continues it
    from the checkpoint that it saves at its end.
    """

    track: TrackDocument
    race_type: str
    metadata: MetadataDocument
    algorithm: str
    hyperparameters: Hyperparameters
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
    more_tracks: list[TrackAndLook] = field(default_factory=list)
    alternate_direction: bool = False
    randomise: dict[str, float] = field(default_factory=dict)
    continues: bool = False

    @property
    def guided(self) -> bool:
        """Whether a guide leads the first updates of a new car (:class:`.learners.Learner`): the state of the road that
        it sees knows no boxes and no bots."""
        return self.algorithm == "ppo" and self.race_type == TIME_TRIAL and self.build == OURS

    @property
    def ways(self) -> int:
        return (1 + len(self.more_tracks)) * (2 if self.alternate_direction else 1)

    @property
    def trials_driven(self) -> int:
        """Trials of an evaluation: ``trials``, and at least one on each way."""
        return max(self.trials, self.ways)

    @property
    def updates_a_look(self) -> int:
        """Updates between evaluations: more for many ways, so that driving keeps the same share of the time."""
        return -(-self.trials_driven // self.trials)

    @property
    def warmth(self) -> Warmth:
        batch = self.hyperparameters["batch_size"]
        ppo = self.algorithm == "ppo"
        driven = {CARS * self.steps_each, CARS * self.rollout_steps(self._full_rollouts)}
        return {
            "metadata": self.metadata,
            "build": self.build,
            "learned": sorted({batch, *(count % batch or batch for count in driven)} if ppo else {batch}),
            "driven": [*range(1, self.trials_driven + 1), CARS],
        }

    @property
    def steps_each(self) -> int:
        """Control steps of each car between two updates. The field counts episodes of :data:`EPISODE_STEPS`, so 100 of
        them are its own cap of 10,000 steps an update."""
        return -(-self.hyperparameters["num_episodes_between_training"] * EPISODE_STEPS // CARS)

    def rollout_steps(self, done: int) -> int:
        """Control steps of each car until the next update, after ``done`` steps of all; ``stop_steps`` cuts the last of
        these short."""
        if self.stop_steps is None or self.stop_steps <= done:
            return self.steps_each
        return min(self.steps_each, -(-(self.stop_steps - done) // CARS))

    @property
    def _full_rollouts(self) -> int:
        """Steps of all cars before the rollout that ``stop_steps`` cuts short."""
        each = CARS * self.steps_each
        return 0 if self.stop_steps is None else self.stop_steps // each * each
