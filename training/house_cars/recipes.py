"""The recipe of each house car: its character, actions and training settings."""

from dataclasses import dataclass
from typing import Any

from paddock.packages.metadata import MetadataDocument

# Where they learn and are measured: the demo season's six, our oval, and two that everybody knows, one of them narrow
TRACKS = (
    "baja-turnpike",
    "baja-highway",
    "kuei-raceway",
    "kuei-super-raceway",
    "cosmic-loop",
    "cosmic-circuit",
    "oval",
    "a-to-z-speedway",
    "reinvent-2018",
)


@dataclass(frozen=True)
class Recipe:
    """One house car. ``steps``: control steps of training. ``learning_rate`` to ``epochs`` are PPO's, whose other
    settings are the same for all (see :mod:`.learner`)."""

    name: str
    display_name: str
    description: str
    action_space_type: str
    action_space: Any  # as in model_metadata.json
    steps: int
    focus: float  # how much the reward prefers the middle of the road; 0: none
    seed: int = 0
    learning_rate: float = 5e-4
    gamma: float = 0.97
    entropy: float = 0.01
    epochs: int = 4
    log_std: float = 0.0  # continuous: spread of the first actions, as its logarithm
    first_action: tuple[float, ...] = ()  # continuous: where the untrained network begins; empty: in the middle

    @property
    def metadata(self) -> MetadataDocument:
        return {
            "action_space": self.action_space,
            "action_space_type": self.action_space_type,
            "sensor": ["FRONT_FACING_CAMERA"],
            "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
            "training_algorithm": "clipped_ppo",
            "version": "3",
        }


def _actions(*pairs: tuple[float, float]) -> list[dict[str, float]]:
    return [{"steering_angle": angle, "speed": speed} for angle, speed in pairs]


STEADY = Recipe(
    name="steady",
    display_name="Steady",
    description="Five actions, about one metre a second, always near the middle. The first car to beat.",
    action_space_type="discrete",
    action_space=_actions((-30, 0.9), (-15, 1.0), (0, 1.1), (15, 1.0), (30, 0.9)),
    steps=40_000,
    focus=1.0,
)
BRISK = Recipe(
    name="brisk",
    display_name="Brisk",
    description="Eleven actions: brakes for the hairpins and runs at well over two metres a second on the straights.",
    action_space_type="discrete",
    action_space=_actions(
        *((angle, speed) for angle in (-30, 30) for speed in (1.2,)),
        *((angle, speed) for angle in (-20, -10, 0, 10, 20) for speed in (1.4,)),
        *((angle, speed) for angle in (-10, 0, 10) for speed in (2.2,)),
        (0, 2.8),
    ),
    steps=140_000,
    focus=0.5,
    gamma=0.98,
)
FLYER = Recipe(
    name="flyer",
    display_name="Flyer",
    description="Steering and speed without steps, up to three and a half metres a second. The fastest.",
    action_space_type="continuous",
    action_space={
        "steering_angle": {"low": -30.0, "high": 30.0},
        "speed": {"low": 0.8, "high": 3.6},
    },
    steps=320_000,
    focus=0.5,
    learning_rate=3e-4,
    entropy=0.0,
    epochs=10,
    log_std=-0.7,
    first_action=(0.0, -0.6),  # a car that crawls stays on the road long enough to learn to steer
)

RECIPES: dict[str, Recipe] = {recipe.name: recipe for recipe in (STEADY, BRISK, FLYER)}
