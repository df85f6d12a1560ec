"""The default configuration of the environments: every option, with its unit and its default."""

from collections.abc import Mapping
from typing import Any

from paddock.rules.race import RUN_RULES, TIME_TRIAL

from ..camera.theme import OFFICIAL
from ..physics import PADDOCK_CAR
from ..rewards import avoid_objects, follow_centre_line

# Five angles at two speeds, the console's default at speeds that finish a lap in reasonable time.
DEFAULT_METADATA: Mapping[str, Any] = {
    "action_space_type": "discrete",
    "action_space": [
        {"steering_angle": angle, "speed": speed} for angle in (-30, -15, 0, 15, 30) for speed in (1.0, 1.5)
    ],
    "sensor": ["FRONT_FACING_CAMERA"],
}
DICT, BOX, RGB = OBSERVATIONS = ("dict", "box", "rgb")
FIXED, RANDOM = STARTS = ("fixed", "random")

OPTIONS: Mapping[str, Any] = {
    # A name of the catalogue (``penbay_open`` as well), the path of a .npy file, or a TrackGeometry.
    "track": "oval",
    # A ``model_metadata.json``: actions (degrees, m/s) and sensors.
    "metadata": DEFAULT_METADATA,
    # "fixed": on the finish line. "random": anywhere on the centre line.
    "start": FIXED,
    # The seed of boxes and bots in every episode; None draws one for each, from the seed of ``reset``.
    "layout_seed": None,
    # ``reward_function(params) -> float``, called after each step; with boxes or bots: avoid_objects.
    "reward_function": follow_centre_line,
    # "dict": an entry for each sensor. "box": the reading of the only sensor. "rgb": the same as three equal channels.
    "observation": DICT,
    # Colours of road, lines, field and walls.
    "theme": OFFICIAL,
    # Dimensions (metres), mass (kg) and response (seconds) of the car.
    "physics": PADDOCK_CAR,
    # Other tracks, each alone or with its theme; each episode draws one of all, from the seed of ``reset``.
    "more_tracks": (),
    # Whether a car's every second episode drives in the other direction.
    "alternate_direction": False,
    # Strengths from 0 to 1 of what each episode draws anew, by name: light, colours, start, sensors, latency.
    "randomise": None,
}


def default_config(race_type: str) -> dict[str, Any]:
    """Every option of the environment of this race type: :data:`OPTIONS`, then the race rules
    (:mod:`paddock.rules.race`)."""
    reward_function = OPTIONS["reward_function"] if race_type == TIME_TRIAL else avoid_objects
    rules = rules_of_episodes(race_type)
    proposed = {name: RUN_RULES[name].proposed for name in rules if RUN_RULES[name].proposed is not None}
    return {**OPTIONS, "reward_function": reward_function, **rules, **proposed}


def rules_of_episodes(race_type: str) -> dict[str, object]:
    """The race rules of an environment of this type, and their defaults in an episode."""
    rules = (rule for name, rule in RUN_RULES.items() if name not in ("race_type", "seed"))
    return {rule.name: rule.default_of_an_episode for rule in rules if rule.belongs_to(race_type)}
