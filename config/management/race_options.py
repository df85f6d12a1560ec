"""The rules of a race as options of a command, refused with the codes that the site's forms and API give."""

from __future__ import annotations

import math
from argparse import ArgumentParser
from typing import Any

from config.management import Refusal
from paddock.errors import UserFault
from paddock.simulator.rules import (
    BOT_SPEED_RANGE_MPS,
    DIRECTIONS,
    HEAD_TO_HEAD,
    LANES,
    MAX_BOTS,
    MAX_BOXES,
    OBJECT_AVOIDANCE,
    RACE_TYPES,
    BoxPlace,
    RaceRules,
)


def add_race_options(parser: ArgumentParser) -> None:
    """Everything that :func:`rules_of` reads."""
    rules = RaceRules()
    parser.add_argument("--race-type", choices=RACE_TYPES, default=rules.race_type, help="default: %(default)s")
    parser.add_argument("--direction", choices=DIRECTIONS, default=rules.direction, help="default: %(default)s")
    parser.add_argument("--laps", type=int, default=rules.laps, help="default: %(default)s")
    parser.add_argument(
        "--seed", type=int, default=rules.seed, help="of boxes and of bots' lane changes; default: %(default)s"
    )
    for option, milliseconds in (
        ("--off-track-penalty", rules.off_track_penalty_ms),
        ("--collision-penalty", rules.collision_penalty_ms),
    ):
        parser.add_argument(
            option, type=float, default=milliseconds / 1000, metavar="SECONDS", help="default: %(default)s"
        )
    parser.add_argument(
        "--max-resets",
        type=int,
        default=rules.max_resets,
        help="0: the first fault ends the run; default: %(default)s",
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        default=rules.max_simulated_ms / 1000,
        metavar="SECONDS",
        help="of simulated time; default: %(default)s",
    )
    parser.add_argument(
        "--obstacles",
        type=int,
        default=0,
        metavar="N",
        help=f"boxes in places drawn from the seed, at most {MAX_BOXES}",
    )
    parser.add_argument(
        "--obstacle-distance",
        type=float,
        default=rules.box_distance_m,
        metavar="METRES",
        help="between drawn boxes at least, along the track; default: %(default)s",
    )
    parser.add_argument(
        "--box",
        action="append",
        default=[],
        metavar="FRACTION:LANE",
        help=f"a box in a fixed place: the share of the lap driven there and the lane ({', '.join(LANES)}); repeat it",
    )
    parser.add_argument("--bots", type=int, default=0, metavar="N", help=f"bot cars, at most {MAX_BOTS}")
    parser.add_argument("--bot-speed", type=float, metavar="MPS", help=f"of bot cars; default: {rules.bot_speed_mps}")
    parser.add_argument("--lane-changes", action="store_true", help="bot cars change lanes")


def rules_of(options: dict[str, Any]) -> RaceRules:
    """The rules that the options name. Raises UserFault for boxes and bots that cannot be, Refusal otherwise."""
    boxes = _boxes(options)
    _check_bots(options)
    try:
        return RaceRules(
            race_type=options["race_type"],
            laps=options["laps"],
            seed=options["seed"],
            direction=options["direction"],
            max_resets=options["max_resets"],
            off_track_penalty_ms=_milliseconds(options, "off_track_penalty"),
            collision_penalty_ms=_milliseconds(options, "collision_penalty"),
            max_simulated_ms=_milliseconds(options, "time_limit"),
            boxes=boxes,
            random_boxes=options["obstacles"],
            box_distance_m=options["obstacle_distance"],
            bots=options["bots"],
            bot_speed_mps=_bot_speed(options),
            bot_lane_changes=options["lane_changes"],
        )
    except ValueError as error:
        raise Refusal(UserFault("rules_senseless", problem=str(error))) from error


def _milliseconds(options: dict[str, Any], name: str) -> int:
    seconds = options[name]
    if not math.isfinite(seconds):
        raise ValueError(f"{name} must be a number of seconds, not {seconds}")
    return round(seconds * 1000)


def _boxes(options: dict[str, Any]) -> tuple[BoxPlace, ...]:
    places, drawn = options["box"], options["obstacles"]
    if options["race_type"] != OBJECT_AVOIDANCE:
        if places or drawn:
            raise UserFault("race_has_no_boxes")
        return ()
    if places and drawn:
        raise UserFault("race_boxes_fixed_or_random")
    if len(places) + drawn < 1:
        raise UserFault("race_needs_boxes", most=MAX_BOXES)
    if len(places) + drawn > MAX_BOXES:
        raise UserFault("race_too_many_boxes", most=MAX_BOXES)
    return tuple(map(_place, places))


def _place(text: str) -> BoxPlace:
    fraction, _, lane = text.partition(":")
    try:
        return BoxPlace(float(fraction), lane)
    except ValueError:
        raise UserFault("race_boxes_shape", lanes=" | ".join(LANES)) from None


def _check_bots(options: dict[str, Any]) -> None:
    described = options["lane_changes"] or options["bot_speed"] is not None
    if options["race_type"] != HEAD_TO_HEAD:
        if options["bots"] or described:
            raise UserFault("race_has_no_opponents")
    elif not 0 <= options["bots"] <= MAX_BOTS or (described and not options["bots"]):
        raise UserFault("race_bot_count", most=MAX_BOTS)
    least, most = BOT_SPEED_RANGE_MPS
    if not least <= _bot_speed(options) <= most:
        raise UserFault("race_bot_speed", least=f"{least:g}", most=f"{most:g}")


def _bot_speed(options: dict[str, Any]) -> float:
    return RaceRules.bot_speed_mps if options["bot_speed"] is None else options["bot_speed"]
