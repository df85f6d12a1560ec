"""Valid combinations of a race's layout values, as database constraints and as messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Func, Q
from django.db.models.lookups import LessThanOrEqual

from paddock.rules.race import BOX_FRACTIONS, LANES, MAX_BOTS, MAX_BOXES, RULES

from ..errors import problem
from .choices import DuelFormat, Opponents, RaceType
from .rules import Ruled, within

if TYPE_CHECKING:
    from django.db.backends.base.base import BaseDatabaseWrapper
    from django.db.models.sql.compiler import SQLCompiler


class FixedBox(TypedDict):
    """A box in a fixed place, as ``Race.boxes`` holds it."""

    fraction: float
    lane: str


class _Length(Func):
    """How many values a JSON list has."""

    arity = 1
    function = "JSON_ARRAY_LENGTH"
    output_field = models.IntegerField()

    def as_postgresql(self, compiler: SQLCompiler, connection: BaseDatabaseWrapper, **context: Any) -> tuple:
        return super().as_sql(compiler, connection, function="JSONB_ARRAY_LENGTH", **context)


_NO_BOXES = Q(boxes=[], random_boxes=0)
_NO_OPPONENTS = Q(opponents="", bots=0, duel_format="")

CONSTRAINTS = (
    models.CheckConstraint(
        condition=Q(race_type="time_trial") & _NO_BOXES & _NO_OPPONENTS
        | Q(race_type="object_avoidance") & ~_NO_BOXES & _NO_OPPONENTS
        | Q(race_type="head_to_head") & _NO_BOXES & ~Q(opponents=""),
        name="race_type_has_its_own_options",
    ),
    models.CheckConstraint(
        condition=Q(random_boxes__lte=MAX_BOXES, boxes=[]) | Q(random_boxes=0) & ~Q(boxes=[]),
        name="race_boxes_are_fixed_or_drawn",
    ),
    models.CheckConstraint(condition=LessThanOrEqual(_Length("boxes"), MAX_BOXES), name="race_box_count"),
    models.CheckConstraint(condition=within("box_distance_m"), name="race_box_distance_range"),
    models.CheckConstraint(
        condition=Q(opponents="", bots=0, duel_format="")
        | Q(opponents="bots", bots__gte=1, bots__lte=MAX_BOTS, duel_format="")
        | Q(opponents="models", bots=0, duel_format="round_robin")
        | Q(opponents="models", bots=0, duel_format="bracket", duel_cars=2),
        name="race_opponents_are_bots_or_models",
    ),
    models.CheckConstraint(condition=within("bot_speed_mps"), name="race_bot_speed_range"),
    models.CheckConstraint(condition=within("duel_cars"), name="race_duel_cars_range"),
)


def problems_of(race: Ruled) -> dict[str, ValidationError]:
    """Contradictions in a race's boxes, bots and opponents, by field; their room on the track is checked elsewhere."""
    problems = _range_problems(race)
    if race.race_type == RaceType.OBJECT_AVOIDANCE:
        problems |= _box_problems(race)
    else:
        problems |= {name: problem("race_has_no_boxes") for name in ("boxes", "random_boxes") if getattr(race, name)}
    if race.race_type == RaceType.HEAD_TO_HEAD:
        problems |= _opponent_problems(race)
    else:
        given = (name for name in ("opponents", "bots", "duel_format") if getattr(race, name))
        problems |= {name: problem("race_has_no_opponents") for name in given}
    return problems


_CHANGE_TIMES = ("bot_lane_change_least_ms", "bot_lane_change_most_ms")
_RANGES = {
    "box_distance_m": "race_box_distance",
    "bot_speed_mps": "race_bot_speed",
    "duel_cars": "race_duel_cars",
    "duel_heats": "race_duel_heats",
    "bot_lane_change_m": "race_bot_lane_change",
    "duel_gap_m": "race_duel_gap",
    **dict.fromkeys(_CHANGE_TIMES, "race_bot_change_time"),
}


def _range_problems(race: Ruled) -> dict[str, ValidationError]:
    """Values out of range for every type of race; fields themselves report None."""
    problems = {}
    for name, code in _RANGES.items():
        value = getattr(race, name)
        least, most = RULES[name].bounds
        scale = 1000 if RULES[name].unit == "ms" else 1
        if isinstance(value, int | float) and not least <= value <= most:
            problems[name] = problem(code, least=f"{least / scale:g}", most=f"{most / scale:g}")
    low, high = (getattr(race, name) for name in _CHANGE_TIMES)
    if not problems.keys() & {*_CHANGE_TIMES} and isinstance(low, int) and isinstance(high, int) and low > high:
        problems[_CHANGE_TIMES[1]] = problem("race_bot_change_times")
    return problems


def _box_problems(race: Ruled) -> dict[str, ValidationError]:
    if not _is_list_of_places(race.boxes):
        return {"boxes": problem("race_boxes_shape", lanes=" | ".join(LANES))}
    if race.boxes and race.random_boxes:
        return {"random_boxes": problem("race_boxes_fixed_or_random")}
    if not race.boxes and not race.random_boxes:
        return {"boxes": problem("race_needs_boxes", most=MAX_BOXES)}
    if len(race.boxes) > MAX_BOXES or race.random_boxes > MAX_BOXES:
        return {"boxes": problem("race_too_many_boxes", most=MAX_BOXES)}
    for number, box in enumerate(race.boxes, start=1):
        if refused := misplaced(number, box["fraction"]):
            return {"boxes": refused}
    return {}


def misplaced(number: int, fraction: float) -> ValidationError | None:
    """Why box ``number`` may not stand at this share of the lap; None where it may."""
    least, most = BOX_FRACTIONS
    if least <= fraction <= most:
        return None
    return problem("race_box_place", number=number, least=f"{least:.0%}", most=f"{most:.0%}")


def _is_list_of_places(boxes: object) -> bool:
    return isinstance(boxes, list) and all(
        isinstance(box, dict)
        and set(box) == {"fraction", "lane"}
        and isinstance(box["fraction"], int | float)
        and not isinstance(box["fraction"], bool)
        and box["lane"] in LANES
        for box in boxes
    )


def _opponent_problems(race: Ruled) -> dict[str, ValidationError]:
    if race.opponents == Opponents.BOTS:
        problems = {}
        if isinstance(race.bots, int) and not 1 <= race.bots <= MAX_BOTS:
            problems["bots"] = problem("race_bot_count", most=MAX_BOTS)
        if race.duel_format:
            problems["duel_format"] = problem("race_bots_have_no_duels")
        return problems
    if race.opponents == Opponents.MODELS:
        problems = {}
        if race.bots:
            problems["bots"] = problem("race_duels_have_no_bots")
        if race.duel_format not in DuelFormat.values:
            problems["duel_format"] = problem("race_needs_duel_format")
        elif race.duel_format == DuelFormat.BRACKET and race.duel_cars != 2:
            problems["duel_cars"] = problem("race_bracket_of_pairs")
        return problems
    return {"opponents": problem("race_needs_opponents")}
