"""The list of training settings besides the reward function."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .hyperparameters import PPO
from .race import RUN_RULES, RaceRules
from .rule import gettext_noop as _
from .rule import pgettext_noop as pgettext
from .rule import rule, rules_in

BEST_METRICS = ("progress", "reward", "lap_time")
PARAMS, POSITIONAL = ("params", "positional")
_MOST = 2**31 - 1
MOST_TRACKS = 8  # in one training


def _strength(label: str, help_: str) -> Any:
    return rule(0, label=label, help=help_, between=(0, 100), column=True, added=True)


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """The settings of a training, checked when it is requested. ``action_space`` and ``action_space_type``: as in
    ``model_metadata.json``. ``boxes``: ``{"fraction", "lane"}`` each. ``seed``: None draws one."""

    action_space_type: str
    action_space: Any
    direction: str = RaceRules.direction
    race_type: str = RaceRules.race_type
    boxes: Sequence[Mapping[str, Any]] = ()
    random_boxes: int = RaceRules.random_boxes
    bots: int = RaceRules.bots
    bot_speed_mps: float = RaceRules.bot_speed_mps
    bot_lane_changes: bool = RaceRules.bot_lane_changes
    bot_lane_change_m: float = RaceRules.bot_lane_change_m
    bot_lane_change_least_ms: int = RaceRules.bot_lane_change_least_ms
    bot_lane_change_most_ms: int = RaceRules.bot_lane_change_most_ms
    standing_laps: bool = RaceRules.standing_laps
    algorithm: str = PPO
    hyperparameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    reward_signature: str = PARAMS
    stop_minutes: int = rule(
        10,
        label=_("Time limit in minutes"),
        help=_("Real time, 1 to 1440."),
        between=(1, 1440),
        column=True,
    )
    stop_clean_laps: int | None = rule(
        None,
        label=_("Clean laps in a row"),
        help=_("Ends the training after this many consecutive laps on the road."),
        between=(1, 10),
        column=True,
    )
    stop_steps: int | None = rule(
        None,
        label=pgettext("of a simulation", "Steps"),
        context="of a simulation",
        help=_("15 steps are one second of driving."),
        between=(1, _MOST),
        column=True,
    )
    trials: int = rule(
        3,
        label=_("Trials of an evaluation"),
        help=_("Laps without exploration after each update."),
        between=(1, 10),
        column=True,
    )
    best_metric: str = rule(
        "progress",
        label=_("Best by"),
        help=_("Criterion for the best evaluation. Its model is kept beside the last one."),
        choices=BEST_METRICS,
        column=True,
    )
    seed: int | None = rule(None, label=_("Seed"), between=(0, _MOST), column=True)
    alternate_direction: bool = rule(
        False,
        label=_("Alternate direction"),
        help=_("Every second episode runs in the other direction."),
        column=True,
    )
    random_light: int = _strength(_("Light"), _("How bright the camera's picture is."))
    random_colours: int = _strength(_("Colours"), _("Grey values of road, lines, field, walls, boxes and cars."))
    random_start: int = _strength(_("Start"), _("Start off the centre line, at an angle."))
    random_sensors: int = _strength(_("Sensor noise"), _("Grain in the camera picture and noise in lidar distances."))
    random_latency: int = _strength(_("Latency"), _("Actions take effect up to 0.2 s late."))


SETTINGS = rules_in(TrainingSettings)
# Those that are race rules.
DRIVEN_BY = tuple(
    field.name
    for field in dataclasses.fields(TrainingSettings)
    if field.name in RUN_RULES and field.name not in SETTINGS
)
# The strengths of the changes that each episode draws, in per cent.
RANDOMISED = tuple(name for name in SETTINGS if name.startswith("random_"))
ENDING = tuple(name for name in SETTINGS if name not in ("seed", "alternate_direction", *RANDOMISED))
KEPT = (*ENDING, "alternate_direction", *RANDOMISED)


def randomisation(values: Mapping[str, int]) -> dict[str, float]:
    """The strengths above 0, as environments take them, from percentages by the names of :data:`RANDOMISED`."""
    return {name.removeprefix("random_"): values[name] / 100.0 for name in RANDOMISED if values.get(name)}


def taken_from(values: Mapping[str, Any]) -> tuple[TrainingSettings, dict[str, Any]]:
    """The settings among ``values``, and the rest. Raises TypeError without an action space."""
    names = {field.name for field in dataclasses.fields(TrainingSettings)}
    rest = {name: value for name, value in values.items() if name not in names}
    return TrainingSettings(**{name: value for name, value in values.items() if name in names}), rest
