"""The list of race rules: what a race asks and punishes, as plain values that cross a pipe as JSON.

Two classes hold it. A run is told :class:`RaceRules`; :class:`BoardRules` are what an organiser chooses besides: who is
ranked how, how often a car is sent and with what. To add a rule, add a field here and read it where it acts.
"""

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
AVERAGE, BEST, TOTAL = RANKING_METHODS = ("average", "best", "total")
BOTS, MODELS = OPPONENTS = ("bots", "models")
ROUND_ROBIN, BRACKET = DUEL_FORMATS = ("round_robin", "bracket")

# Of the track's lanes: the one beside the inner border and the one beside the outer border, whatever the direction.
INNER, OUTER = "inner", "outer"
LANES = (INNER, OUTER)

MAX_BOXES = 10  # console API
MAX_BOTS = 6  # console API
MAX_CARS = 4  # in one world, model against model
BOT_SPEED_RANGE_MPS = (0.2, 4.0)
# Where a race may have a fixed box, as a share of the lap: not where cars start or finish (DRoA's race form).
BOX_FRACTIONS = (0.07, 0.90)


@dataclass(frozen=True)
class BoxPlace:
    """Where a box stands: the share of a lap driven there from the finish line, in [0, 1), and the lane it stands in
    the middle of."""

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
    """What a run is told. Raises ValueError at construction when a value makes no sense; whether boxes have room on a
    certain track is for :mod:`paddock.simulator.layout`.

    Defaults: deepracer-simapp, evaluation_worker.py. Penalties are stood still on the track, in whole control steps
    (1/15 s, rounded up). Object avoidance has ``boxes`` or ``random_boxes``, 1 to 10; head-to-head has ``bots``, or
    none and submitted cars race each other.
    """

    race_type: str = rule(TIME_TRIAL, label=_("Race type"), choices=RACE_TYPES, column=True)
    laps: int = rule(
        3, place=2, label=_("Laps driven"), least=1, most=20, beyond=True, episode=1, stage=True, column=True
    )
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
        unit="ms",
        least=0,
        most=60_000,
        beyond=True,
        stage=True,
        column=True,
    )
    collision_penalty_ms: int = rule(
        5000,
        place=5,
        label=_("Collision penalty"),
        help=_("After hitting a box, a bot or another car."),
        unit="ms",
        least=0,
        most=60_000,
        beyond=True,
        race_types=(OBJECT_AVOIDANCE, HEAD_TO_HEAD),
        stage=True,
        column=True,
    )
    # over all laps
    max_resets: int = rule(
        10_000,
        place=6,
        label=_("Resets allowed"),
        help=_("0: the first fault ends the run."),
        least=0,
        most=10_000,
        beyond=True,
        unlimited=10_000,
        episode=0,
        stage=True,
        column=True,
    )
    max_simulated_ms: int = rule(
        180_000,
        place=7,
        label=_("Time limit"),
        help=_("Simulated time for the whole run."),
        unit="ms",
        least=10_000,
        most=1_200_000,
        beyond=True,
        episode=60_000,
        stage=True,
        column=True,
        option="time-limit",
    )
    seed: int = rule(
        0,
        label=_("Seed"),
        help=_("The same seed gives everyone the same draws."),
        least=0,
        most=2**31 - 1,
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
        least=0,
        most=1000,
        run_only=True,
        option="start",
    )
    boxes: tuple[BoxPlace, ...] = rule(
        (),
        label=_("Boxes"),
        help=_("Percentages of the lap from the finish line, in the direction driven."),
        race_types=(OBJECT_AVOIDANCE,),
        layout=True,
        column=True,
    )
    # instead of fixed places, drawn from the seed
    random_boxes: int = rule(
        0,
        label=_("How many boxes"),
        least=1,
        most=MAX_BOXES,
        beyond=True,
        race_types=(OBJECT_AVOIDANCE,),
        layout=True,
        column=True,
        proposed=6,
        option="obstacles",
    )
    box_distance_m: float = rule(
        2.0,
        label=_("Minimum distance between boxes (m)"),
        unit="m",
        least=0.5,
        most=20.0,
        beyond=True,
        race_types=(OBJECT_AVOIDANCE,),
        layout=True,
        column=True,
        option="obstacle-distance",
    )
    # At so many resets near one box the car is put behind it (0: never), because the same car in the same place would
    # do the same for ever. Simapp has this rule (ENABLE_MERCY_RESET, with 3) but off: its runs differ.
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
        least=1,
        most=MAX_BOTS,
        beyond=True,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        column=True,
        proposed=4,
    )
    bot_speed_mps: float = rule(
        1.0,
        label=_("Bot speed in m/s"),
        unit="m/s",
        least=BOT_SPEED_RANGE_MPS[0],
        most=BOT_SPEED_RANGE_MPS[1],
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        column=True,
        option="bot-speed",
    )
    bot_lane_changes: bool = rule(
        False,
        label=_("Bots change lanes"),
        help=_("At times drawn from the seed."),
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        option="lane-changes",
    )
    bot_lane_change_m: float = rule(
        1.0,
        label=_("Length of a lane change (m)"),
        help=_("Shorter means a more sudden lane change."),
        unit="m",
        least=0.5,
        most=5.0,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        added=True,
        option="lane-change-distance",
    )
    duel_gap_m: float = rule(
        0.75,
        label=_("Distance between cars at the start (m)"),
        help=_("Cars start one behind the other, alternating lanes."),
        unit="m",
        least=0.5,
        most=2.0,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        option="start-gap",
    )
    bot_lane_change_least_ms: int = rule(
        3000,
        label=_("Shortest time between lane changes"),
        help=_("Each bot draws times between the two limits from the seed."),
        unit="ms",
        least=500,
        most=60_000,
        beyond=True,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        added=True,
        option="lane-change-least",
    )
    bot_lane_change_most_ms: int = rule(
        5000,
        label=_("Longest time between lane changes"),
        unit="ms",
        least=500,
        most=60_000,
        beyond=True,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
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
        """Those of an environment's episode, one lap until the first fault, where ``rules`` say nothing else."""
        return cls(**{one.name: one.episode for one in RUN_RULES.values() if one.episode is not None} | rules)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values. What came later (:data:`SINCE_THE_FIRST`) is not named where it is as it always was: while
        a site is upgraded, a worker of before does not know it."""
        told = dataclasses.asdict(self)
        # under the one name that they had before organisers could set them
        told[_CHANGE_TIMES_TOLD] = tuple(told.pop(name) for name in _CHANGE_TIMES)
        for name in SINCE_THE_FIRST:
            if told[name] == RUN_RULES[name].default:
                del told[name]
        return told

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RaceRules:
        """The rules that :meth:`to_dict` wrote, also after a way through JSON. Raises TypeError for an unknown key,
        ValueError for a bad value."""
        values = dict(data)
        if "boxes" in values:
            values["boxes"] = tuple(BoxPlace(**box) for box in values["boxes"])
        if _CHANGE_TIMES_TOLD in values:
            values |= zip(_CHANGE_TIMES, values.pop(_CHANGE_TIMES_TOLD), strict=True)
        if "speed_commands" in values:
            values["speed_commands"] = tuple(SpeedCommand(**command) for command in values["speed_commands"])
        return cls(**values)


@dataclass(frozen=True)
class BoardRules:
    """What an organiser chooses besides: who is ranked how, how often a car is sent and with what, against whom."""

    sensors: tuple[str, ...] = rule(
        ("FRONT_FACING_CAMERA",),
        label=_("Sensors offered"),
        help=_("Models that need other sensors cannot enter."),
        column=True,
    )
    ranking_method: str = rule(AVERAGE, place=1, label=_("Ranked by"), choices=RANKING_METHODS, stage=True, column=True)
    minimum_laps: int = rule(
        RaceRules.laps,
        place=3,
        label=_("Consecutive laps to be classified"),
        short=_("Laps in a row"),
        help=_("The average is taken over this many consecutive complete laps."),
        least=1,
        most=20,
        stage=True,
        column=True,
    )
    max_submissions: int | None = rule(
        50,
        optional=True,
        place=8,
        label=_("Submissions per racer"),
        short=_("Submissions"),
        help=_("Empty: no limit, as in races of the league unless they set one."),
        least=1,
        most=1000,
        fixed=False,
        stage=True,
        column=True,
    )
    shared_cars: bool = rule(
        False,
        label=_("Racers may share a car"),
        help=_("For teams and classes. Otherwise the first racer to submit a car keeps its place."),
        column=True,
    )
    opponents: str = rule(
        "", label=_("Opponents"), choices=OPPONENTS, race_types=(HEAD_TO_HEAD,), layout=True, column=True, proposed=BOTS
    )
    duel_format: str = rule(
        "",
        label=_("Duels"),
        choices=DUEL_FORMATS,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        column=True,
        proposed=ROUND_ROBIN,
    )
    duel_cars: int = rule(
        2,
        label=_("Cars on the track at once"),
        least=2,
        most=MAX_CARS,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        column=True,
    )
    duel_heats: int = rule(
        2,
        label=_("Heats per duel in a bracket"),
        help=_(
            "1: the better qualifier in front. 2: with swapped start positions. 3: best of three, "
            "the third heat only at one win each."
        ),
        least=1,
        most=3,
        race_types=(HEAD_TO_HEAD,),
        layout=True,
    )
    duels_live_only: bool = rule(
        False,
        label=_("Draw the duels only live"),
        help=_(
            "The duels are drawn when the live event begins, or when you press the button. "
            "Closing the race does not draw them."
        ),
        race_types=(HEAD_TO_HEAD,),
        layout=True,
        fixed=False,
    )


LIVE_LAPS = 1000  # of a run in a live event: its time ends it
RUN_RULES = rules_in(RaceRules)
SINCE_THE_FIRST = ("start_m", "standing_laps", "bot_lane_change_m", "duel_gap_m", "speed_commands")
_CHANGE_TIMES, _CHANGE_TIMES_TOLD = ("bot_lane_change_least_ms", "bot_lane_change_most_ms"), "bot_lane_change_ms"
# All that an organiser sets of a race, by name.
RULES: Mapping[str, Rule] = {
    **{name: one for name, one in RUN_RULES.items() if not one.run_only},
    **rules_in(BoardRules),
}
# What a racer sets of a run of their own: how it drives, where it starts, and what its laps are worth.
OWN_RULES: Mapping[str, Rule] = {
    **{name: one for name, one in RUN_RULES.items() if name in RULES or name == "start_m"},
    **{name: RULES[name] for name in ("ranking_method", "minimum_laps", "opponents")},
}
LAYOUT = tuple(name for name, one in RULES.items() if one.layout)
BY_PLACE = tuple(sorted(RULES, key=lambda name: RULES[name].place))
STAGE = tuple(name for name in BY_PLACE if RULES[name].stage)
# What decides what laps are worth.
RANKING = ("ranking_method", "laps", "minimum_laps")
UNTIL_THE_FIRST_FAULT: Mapping[str, Any] = {"max_resets": 0}
# What makes a race easier to finish comes first: an order of rows.
EASIER_FIRST = ("minimum_laps", "-max_resets")
# What forms and environments propose, where a type of race needs some and nobody has said how many.
PROPOSED_BOXES, PROPOSED_BOTS = RULES["random_boxes"].proposed, RULES["bots"].proposed


def all_laps(laps: int) -> dict[str, Any]:
    """The rules of a race whose laps all count."""
    return dict(zip(RANKING, (TOTAL, laps, laps), strict=True))


def other_direction(direction: str) -> str:
    """The other way round."""
    return DIRECTIONS[1 - DIRECTIONS.index(direction)]


def penalty_steps(penalty_ms: int, control_hz: float) -> int:
    """Control steps that a penalty lasts, rounded up."""
    return math.ceil(penalty_ms * control_hz / 1000.0 - 1e-9)
