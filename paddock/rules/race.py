"""The list of race rules as plain values that can be sent as JSON."""

# To add a rule, add a field here and read it where it takes effect.

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .rule import Rule, rule, rules_in
from .rule import gettext_noop as _
from .speed import SpeedCommand, check_log

TIME_TRIAL, OBJECT_AVOIDANCE, HEAD_TO_HEAD = "time_trial", "object_avoidance", "head_to_head"
RACE_TYPES = (TIME_TRIAL, OBJECT_AVOIDANCE, HEAD_TO_HEAD)
DIRECTIONS = ("ccw", "cw")
AVERAGE, BEST, TOTAL = "average", "best", "total"
# All ranking methods by their names: the site registers a class for each (races.boards.ranking).
RANKING_METHODS: dict[str, Any] = {}
BOTS, MODELS = OPPONENTS = ("bots", "models")
ROUND_ROBIN, BRACKET = DUEL_FORMATS = ("round_robin", "bracket")

# The lanes beside the inner and the outer border, in both directions.
INNER, OUTER = "inner", "outer"
LANES = (INNER, OUTER)

MAX_BOXES = 10  # console API
MAX_BOTS = 6  # console API
MAX_CARS = 4  # in one world, model against model
BOT_SPEED_RANGE_MPS = (0.2, 4.0)
# The shares of the lap for the fixed boxes of a race, away from the start (DRoA's race form).
BOX_FRACTIONS = (0.07, 0.90)

# Attributes that several rules have.
_TIME: Mapping[str, Any] = {"unit": "ms", "beyond": True}
_OF_A_STAGE: Mapping[str, Any] = {"stage": True, "column": True}
_WITH_BOXES: Mapping[str, Any] = {"race_types": (OBJECT_AVOIDANCE,), "layout": True, "column": True}
_WITH_CARS: Mapping[str, Any] = {"race_types": (HEAD_TO_HEAD,), "layout": True}


@dataclass(frozen=True)
class BoxPlace:
    """The place of a box: the share of a lap from the finish line, in [0, 1), and the lane."""

    fraction: float
    lane: str

    def __post_init__(self) -> None:
        value = self.fraction
        if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 <= value <= 1.0:
            raise ValueError(f"fraction must be a number from 0.0 to 1.0, not {value!r}")
        if value >= 1.0:
            raise ValueError("fraction must be less than 1")
        if self.lane not in LANES:
            raise ValueError(f"lane must be one of {LANES}, not {self.lane!r}")


@dataclass(frozen=True)
class RaceRules:
    """The rules of a run. Defaults: deepracer-simapp, evaluation_worker.py. Object avoidance has ``boxes`` or
    ``random_boxes``, 1 to 10; head-to-head has ``bots``, or submitted cars race each other. Raises ValueError."""

    race_type: str = rule(TIME_TRIAL, label=_("Race type"), choices=RACE_TYPES, column=True)
    laps: int = rule(3, place=2, label=_("Laps driven"), between=(1, 20), beyond=True, episode=1, **_OF_A_STAGE)
    standing_laps: bool = rule(
        False,
        place=8,
        label=_("Standing start for every lap"),
        help=_("The car returns to the start after each lap. Otherwise it drives on without stopping."),
    )
    off_track_penalty_ms: int = rule(
        2000,
        place=4,
        label=_("Off-track penalty"),
        short=_("Penalty"),
        help=_("Standing time before the car continues."),
        **_TIME,
        between=(0, 60_000),
        **_OF_A_STAGE,
    )
    collision_penalty_ms: int = rule(
        5000,
        place=5,
        label=_("Collision penalty"),
        help=_("After hitting a box, a bot or another car."),
        **_TIME,
        between=(0, 60_000),
        race_types=(OBJECT_AVOIDANCE, HEAD_TO_HEAD),
        **_OF_A_STAGE,
        of_a_stage=3000,
    )
    # over all laps
    max_resets: int = rule(
        10_000,
        place=6,
        label=_("Resets allowed"),
        help=_("0: the first fault ends the run."),
        between=(0, 10_000),
        beyond=True,
        unlimited=10_000,
        episode=0,
        **_OF_A_STAGE,
    )
    max_simulated_ms: int = rule(
        180_000,
        place=7,
        label=_("Time limit"),
        help=_("Simulated time for the whole run."),
        **_TIME,
        between=(10_000, 1_200_000),
        episode=60_000,
        **_OF_A_STAGE,
        option="time-limit",
        of_a_stage=360_000,
    )
    seed: int = rule(
        0,
        label=_("Seed"),
        help=_("The same seed gives everyone the same draws."),
        between=(0, 2**31 - 1),
        beyond=True,
        column=True,
    )
    direction: str = rule("ccw", label=_("Direction"), choices=DIRECTIONS, column=True)
    # of a run that nobody is ranked by: a race begins and ends at the finish line
    start_m: float = rule(
        0.0,
        label=_("Start"),
        help=_("Metres after the finish line where laps begin and end."),
        unit="m",
        between=(0, 1000),
        run_only=True,
        option="start",
    )
    boxes: tuple[BoxPlace, ...] = rule(
        (),
        label=_("Boxes"),
        help=_("Percentages of the lap from the finish line, in the direction driven."),
        **_WITH_BOXES,
    )
    # instead of fixed places, drawn from the seed
    random_boxes: int = rule(
        0,
        label=_("How many boxes"),
        between=(1, MAX_BOXES),
        beyond=True,
        **_WITH_BOXES,
        proposed=6,
        option="obstacles",
        of_a_stage=4,
    )
    box_distance_m: float = rule(
        2.0,
        label=_("Minimum distance between boxes (m)"),
        unit="m",
        between=(0.5, 20.0),
        beyond=True,
        **_WITH_BOXES,
        option="obstacle-distance",
    )
    # The same car in the same place would crash for ever. Simapp has this rule (ENABLE_MERCY_RESET, with 3) but off.
    mercy_resets: int = rule(
        3,
        label="At which reset near one box the car is put behind it",
        help="0: never.",
        least=0,
        race_types=(OBJECT_AVOIDANCE,),
        run_only=True,
    )
    bots: int = rule(
        0,
        label=_("How many bots"),
        between=(1, MAX_BOTS),
        beyond=True,
        **_WITH_CARS,
        column=True,
        proposed=4,
    )
    bot_speed_mps: float = rule(
        1.0,
        label=_("Bot speed in m/s"),
        unit="m/s",
        between=(BOT_SPEED_RANGE_MPS[0], BOT_SPEED_RANGE_MPS[1]),
        **_WITH_CARS,
        column=True,
        option="bot-speed",
    )
    bot_lane_changes: bool = rule(
        False,
        label=_("Bots change lanes"),
        help=_("At times drawn from the seed."),
        **_WITH_CARS,
        option="lane-changes",
        of_a_stage=True,
    )
    bot_lane_change_m: float = rule(
        1.0,
        label=_("Length of a lane change (m)"),
        help=_("Shorter means a more sudden lane change."),
        unit="m",
        between=(0.5, 5.0),
        **_WITH_CARS,
        added=True,
        option="lane-change-distance",
    )
    duel_gap_m: float = rule(
        0.75,
        label=_("Distance between cars at the start (m)"),
        help=_("Cars start one behind the other, alternating lanes."),
        unit="m",
        between=(0.5, 2.0),
        **_WITH_CARS,
        option="start-gap",
    )
    bot_lane_change_least_ms: int = rule(
        3000,
        label=_("Shortest time between lane changes"),
        help=_("Each bot draws times between the two limits from the seed."),
        **_TIME,
        between=(500, 60_000),
        **_WITH_CARS,
        added=True,
        option="lane-change-least",
    )
    bot_lane_change_most_ms: int = rule(
        5000,
        label=_("Longest time between lane changes"),
        **_TIME,
        between=(500, 60_000),
        **_WITH_CARS,
        added=True,
        option="lane-change-most",
    )
    bot_pause_ms: int = rule(
        2000, label="So long a bot stands after a crash", least=0, race_types=(HEAD_TO_HEAD,), run_only=True
    )
    speed_commands: tuple[SpeedCommand, ...] = rule(
        (),
        label="Speeds that racers commanded while the run was shown live",
        help="At the first control step at or after a command's time.",
        run_only=True,
    )

    def __post_init__(self) -> None:
        for one in RUN_RULES.values():
            one.check(getattr(self, one.name))
        count = len(self.boxes) + self.random_boxes
        if self.boxes and self.random_boxes:
            raise ValueError("boxes have fixed places or random ones, not both")
        if self.race_type == OBJECT_AVOIDANCE and not 1 <= count <= MAX_BOXES:
            raise ValueError(f"object avoidance needs 1 to {MAX_BOXES} boxes, not {count}")
        if self.race_type != OBJECT_AVOIDANCE and count:
            raise ValueError("only object avoidance has boxes")
        if self.race_type != HEAD_TO_HEAD and self.bots:
            raise ValueError("only head-to-head has bots")
        if self.bots > MAX_BOTS:
            raise ValueError(f"bots must be at most {MAX_BOTS}, not {self.bots}")
        least, most = self.bot_lane_change_least_ms, self.bot_lane_change_most_ms
        if not 0 < least <= most:
            raise ValueError(f"bot_lane_change_least_ms must be above 0 and at most {most}, not {least}")
        check_log(self.speed_commands)

    @classmethod
    def of_an_episode(cls, **rules: Any) -> RaceRules:
        """The rules of an environment's episode, by default one lap until the first fault."""
        return cls(**{one.name: one.episode for one in RUN_RULES.values() if one.episode is not None} | rules)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values. Later rules (:data:`SINCE_THE_FIRST`) are left out at their defaults, as older workers do
        not know them."""
        data = dataclasses.asdict(self)
        data[_CHANGE_TIMES_KEY] = tuple(data.pop(name) for name in _CHANGE_TIMES)
        for name in SINCE_THE_FIRST:
            if data[name] == RUN_RULES[name].default:
                del data[name]
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RaceRules:
        """The rules that :meth:`to_dict` wrote. Raises TypeError for an unknown key, ValueError for a bad value."""
        values = dict(data)
        if "boxes" in values:
            values["boxes"] = tuple(BoxPlace(**box) for box in values["boxes"])
        if _CHANGE_TIMES_KEY in values:
            values |= zip(_CHANGE_TIMES, values.pop(_CHANGE_TIMES_KEY), strict=True)
        if "speed_commands" in values:
            values["speed_commands"] = tuple(SpeedCommand(**command) for command in values["speed_commands"])
        return cls(**values)


@dataclass(frozen=True)
class BoardRules:
    """The organiser's rules besides those of a run: ranking, submissions, sensors and opponents."""

    sensors: tuple[str, ...] = rule(
        ("FRONT_FACING_CAMERA",),
        label=_("Sensors offered"),
        help=_("Models that need other sensors cannot enter."),
        column=True,
    )
    ranking_method: str = rule(AVERAGE, place=1, label=_("Ranked by"), choices=RANKING_METHODS, **_OF_A_STAGE)
    minimum_laps: int = rule(
        RaceRules.laps,
        place=3,
        label=_("Consecutive laps to be classified"),
        short=_("Laps in a row"),
        help=_("The average is taken over this many consecutive complete laps."),
        between=(1, 20),
        **_OF_A_STAGE,
    )
    max_submissions: int | None = rule(
        50,
        optional=True,
        place=8,
        label=_("Submissions per racer"),
        short=_("Submissions"),
        help=_("Empty: no limit, as in races of the league unless they set one."),
        between=(1, 1000),
        fixed=False,
        **_OF_A_STAGE,
    )
    shared_cars: bool = rule(
        False,
        label=_("Racers may share a car"),
        help=_("For teams and classes. Otherwise the first racer to submit a car keeps its place."),
        column=True,
    )
    opponents: str = rule("", label=_("Opponents"), choices=OPPONENTS, **_WITH_CARS, column=True, proposed=BOTS)
    duel_format: str = rule(
        "",
        label=_("Duels"),
        choices=DUEL_FORMATS,
        **_WITH_CARS,
        column=True,
        proposed=ROUND_ROBIN,
        of_a_stage=BRACKET,
    )
    duel_cars: int = rule(
        2,
        label=_("Cars on the track at once"),
        between=(2, MAX_CARS),
        **_WITH_CARS,
        column=True,
    )
    duel_heats: int = rule(
        2,
        label=_("Heats per duel in a bracket"),
        help=_(
            "1: the better qualifier in front. 2: with swapped start positions. 3: best of three, "
            "the third heat only at one win each."
        ),
        between=(1, 3),
        **_WITH_CARS,
    )
    duels_live_only: bool = rule(
        False,
        label=_("Draw the duels only live"),
        help=_(
            "The duels are drawn when the live event begins, or when you press the button. "
            "Closing the race does not draw them."
        ),
        **_WITH_CARS,
        fixed=False,
    )


LIVE_LAPS = 1000  # of a run in a live event, which its time ends
RUN_RULES = rules_in(RaceRules)
SINCE_THE_FIRST = ("start_m", "standing_laps", "bot_lane_change_m", "duel_gap_m", "speed_commands")
_CHANGE_TIMES, _CHANGE_TIMES_KEY = ("bot_lane_change_least_ms", "bot_lane_change_most_ms"), "bot_lane_change_ms"
# The rules that an organiser sets.
RULES: Mapping[str, Rule] = {
    **{name: one for name, one in RUN_RULES.items() if not one.run_only},
    **rules_in(BoardRules),
}
# The rules that a racer sets of a test run.
OWN_RULES: Mapping[str, Rule] = {
    **{name: one for name, one in RUN_RULES.items() if name in RULES or name == "start_m"},
    **{name: RULES[name] for name in ("ranking_method", "minimum_laps", "opponents")},
}
LAYOUT = tuple(name for name, one in RULES.items() if one.layout)
BOX_COUNT = "random_boxes"
# The layout rules of a season.
DRAWN_BOXES = (BOX_COUNT, "box_distance_m")
BOTS_DRIVING = ("bots", "bot_speed_mps", "bot_lane_changes")
DUELS = ("duel_format", "duel_cars")
BOX_RULES = ("boxes", *DRAWN_BOXES)
BY_PLACE = tuple(sorted(RULES, key=lambda name: RULES[name].place))
STAGE = tuple(name for name in BY_PLACE if RULES[name].stage)
# Rules that some race types do not have, beside those of the layout.
OF_SOME_TYPES = tuple(name for name, one in RULES.items() if one.race_types and not one.layout)
# Rules that change the time of a lap.
OF_A_LAP_TIME = ("race_type", "off_track_penalty_ms", "collision_penalty_ms", "standing_laps")
PENALTIES = tuple(name for name in OF_A_LAP_TIME if RULES[name].unit == "ms")
# Rules of entering: how often, and with whose car.
OF_ENTERING = ("max_submissions", "shared_cars")
RANKING = ("ranking_method", "laps", "minimum_laps")
ROUND_ROBIN_DUELS: Mapping[str, Any] = {"duel_format": ROUND_ROBIN}
UNTIL_THE_FIRST_FAULT: Mapping[str, Any] = {"max_resets": 0}
# An ordering of rows: races that are easier to finish come first.
EASIER_FIRST = ("minimum_laps", "-max_resets")
# The numbers that forms and environments propose for race types that need some.
PROPOSED_BOXES, PROPOSED_BOTS = RULES["random_boxes"].proposed, RULES["bots"].proposed


def all_laps(laps: int) -> dict[str, str | int]:
    """The rules of a race whose laps all count."""
    return dict(zip(RANKING, (TOTAL, laps, laps), strict=True))


def other_direction(direction: str) -> str:
    return DIRECTIONS[1 - DIRECTIONS.index(direction)]


def penalty_steps(penalty_ms: int, control_hz: float) -> int:
    """Control steps that a penalty lasts, rounded up."""
    return math.ceil(penalty_ms * control_hz / 1000.0 - 1e-9)
