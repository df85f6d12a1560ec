"""Reads ``track_config``, whose values are strings, as arguments of the environments of the races."""

# Names and defaults: the environment variables of DeepRacer-for-Cloud, and deepracer-simapp (rollout_worker.py).

from __future__ import annotations

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import Any

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, INNER, MAX_BOTS, MAX_BOXES, OBJECT_AVOIDANCE, OUTER, RUN_RULES, TIME_TRIAL
from paddock.simulator.envs.setting import Setting, load_track, race_setting
from paddock.simulator.layout import BOX_SPACING_M, START_CLEAR_M, start_places

TIME_LIMIT_MS = 180_000

WORLD, START, WAYS = "WORLD_NAME", "CHANGE_START_POSITION", "ALTERNATE_DRIVING_DIRECTION"
BOXES, PLACES, ANYWHERE, APART = (
    *("NUMBER_OF_OBSTACLES", "OBJECT_POSITIONS", "RANDOMIZE_OBSTACLE_LOCATIONS", "MIN_DISTANCE_BETWEEN_OBSTACLES"),
)
BOTS, BOT_LANES, BOT_GAP = "NUMBER_OF_BOT_CARS", "RANDOMIZE_BOT_CAR_LOCATIONS", "MIN_DISTANCE_BETWEEN_BOT_CARS"
SHORTEST, LONGEST = "LOWER_LANE_CHANGE_TIME", "UPPER_LANE_CHANGE_TIME"

DEFAULT: Mapping[str, str | None] = {
    WORLD: "reInvent2019_wide",
    START: "true",
    WAYS: "true",
    "ENABLE_DOMAIN_RANDOMIZATION": "false",
    BOXES: "0",
    "IS_OBSTACLE_BOT_CAR": "false",
    ANYWHERE: "true",
    PLACES: None,
    APART: "2.0",
    "RESET_BEHIND_DIST": "1.0",
    BOTS: "0",
    BOT_LANES: "true",
    "BOT_CAR_SPEED": "0.2",
    BOT_GAP: "2.0",
    "IS_LANE_CHANGE": "false",
    SHORTEST: "3.0",
    LONGEST: "5.0",
    "LANE_CHANGE_DISTANCE": "1.0",
    "REVERSE_DIR": "false",
    "NUMBER_OF_RESETS": "0",
    "RACE_TYPE": None,
}
_RACE_TYPES = ("TIME_TRIAL", "OBJECT_AVOIDANCE", "HEAD_TO_BOT")
# What only names things, colours the car or arranges the container.
WITHOUT_EFFECT = (
    *("CAR_COLOR", "BODY_SHELL_TYPE", "DISPLAY_NAME", "RACER_NAME", "LEADERBOARD_NAME", "LEADERBOARD_TYPE"),
    *("CAMERA_MAIN_ENABLE", "CAMERA_SUB_ENABLE", "ENABLE_EXTRA_KVS_OVERLAY", "NUM_WORKERS", "JOB_TYPE"),
)
_LANES = {1.0: INNER, -1.0: OUTER}  # deepracer-simapp's numbers


def read_track_config(
    config: Mapping[str, Any] | None, world_name: str | None = None, evaluation: bool = False
) -> dict[str, object]:
    """All keys with their values. ``world_name`` overrides the track; in an evaluation with it, of ``config`` only the
    numbers of obstacles and bot cars count, as in the original. Raises TypeError, ValueError with the name of a key."""
    if config is not None and not isinstance(config, Mapping):
        raise TypeError(f"track_config must be a dict or None, not {type(config).__name__}")
    given = {str(key): value for key, value in (config or {}).items() if value is not None}
    for key in given:
        if key not in DEFAULT and key not in WITHOUT_EFFECT:
            close = get_close_matches(key, DEFAULT, 1)
            hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(DEFAULT)}"
            raise ValueError(f"track_config has {key!r}, which is not possible here; {hint}")
    if evaluation and world_name:
        given = {key: given[key] for key in (BOXES, BOTS) if key in given}
    values = {**DEFAULT, **given}
    return {**values, WORLD: world_name} if world_name else values


def make_setting(values: Mapping[str, Any], **options: Any) -> Setting:
    """The track, the rules and the car of :func:`read_track_config`; ``options``: more of
    :func:`paddock.simulator.envs.setting.race_setting`. Raises ValueError with the name of the key."""
    boxes, bots = _whole(values, BOXES, MAX_BOXES), _whole(values, BOTS, MAX_BOTS)
    places = _places(values)
    _refuse_others(values, bool(boxes or places), bots)
    try:
        track = load_track(values[WORLD])
    except (ValueError, OSError, UserFault) as error:
        raise ValueError(f"{WORLD}: {error}") from error
    chosen: dict[str, Any] = {
        "track": values[WORLD],
        "start": "random" if _flag(values, START) else "fixed",
        "alternate_direction": _flag(values, WAYS),
        "max_simulated_ms": TIME_LIMIT_MS,
    }
    if _flag(values, "REVERSE_DIR"):
        chosen["direction"] = "cw"
    if _flag(values, "ENABLE_DOMAIN_RANDOMIZATION"):
        chosen["randomise"] = {"light": 1.0, "colours": 1.0}
    keys: tuple[str, ...]
    if bots:
        race_type, keys = HEAD_TO_HEAD, (WORLD, BOTS, BOT_GAP)
        chosen |= _bots(values, bots, track)
    elif boxes or places:
        race_type, keys = OBJECT_AVOIDANCE, (WORLD, PLACES) if places else (WORLD, BOXES, APART)
        chosen |= _boxes(values, boxes, places, track)
    else:
        race_type, keys = TIME_TRIAL, (WORLD,)
    try:
        return race_setting(race_type, **chosen, **options)
    except (ValueError, UserFault) as error:
        found = ", ".join(f"{key}={values[key]!r}" for key in keys)
        raise ValueError(f"{error} (track_config: {found})") from error


def _refuse_others(values: Mapping[str, Any], boxes: bool, bots: int) -> None:
    """Refuse what the simulator does not have."""
    if boxes and bots:
        raise ValueError(
            f"{BOXES} (or {PLACES}) and {BOTS} cannot both be set: here races have boxes or bots, not both"
        )
    if boxes and _flag(values, "IS_OBSTACLE_BOT_CAR"):
        raise ValueError(f"IS_OBSTACLE_BOT_CAR must be 'false': obstacles are boxes here; for moving cars set {BOTS}")
    if boxes and _number(values, "RESET_BEHIND_DIST") != 1.0:
        raise ValueError("RESET_BEHIND_DIST must be '1.0': a car begins as near to its place as boxes leave room")
    if _whole(values, "NUMBER_OF_RESETS"):
        raise ValueError("NUMBER_OF_RESETS must be '0': an episode of deepracer-v0 ends at the first fault")
    if values["RACE_TYPE"] not in (None, *_RACE_TYPES):
        raise ValueError(
            f"RACE_TYPE must be one of {', '.join(_RACE_TYPES)}, not {values['RACE_TYPE']!r}: cars of other people do "
            "not drive here"
        )


def _bots(values: Mapping[str, Any], count: int, track: TrackGeometry) -> dict[str, object]:
    least = _number(values, BOT_GAP)
    try:
        places = start_places(track.length, count)
    except UserFault as fault:
        raise ValueError(f"{BOTS}: {fault}") from fault
    if count > 1 and places[1] - places[0] < least:
        raise ValueError(
            f"{BOT_GAP} must be at most {places[1] - places[0]:.2f} for {count} cars on this track, not {least:g}"
        )
    shortest, longest = (
        _ruled(values, key, rule, _ms)
        for key, rule in ((SHORTEST, "bot_lane_change_least_ms"), (LONGEST, "bot_lane_change_most_ms"))
    )
    if shortest > longest:
        raise ValueError(f"{SHORTEST} must be at most {LONGEST}, {values[LONGEST]!r}, not {values[SHORTEST]!r}")
    return {
        "bots": count,
        "bot_speed_mps": _ruled(values, "BOT_CAR_SPEED", "bot_speed_mps", _number),
        "bot_lane_changes": _flag(values, "IS_LANE_CHANGE"),
        "bot_lane_change_m": _ruled(values, "LANE_CHANGE_DISTANCE", "bot_lane_change_m", _number),
        "bot_lane_change_least_ms": shortest,
        "bot_lane_change_most_ms": longest,
        "layout_seed": None if _flag(values, BOT_LANES) else 0,
    }


def _boxes(
    values: Mapping[str, Any], count: int, places: list[tuple[float, str]], track: TrackGeometry
) -> dict[str, object]:
    if places:
        return {"boxes": places}
    apart = _ruled(values, APART, "box_distance_m", _number)
    if _flag(values, ANYWHERE):
        return {"random_boxes": count, "box_distance_m": apart}
    # deepracer-simapp: evenly from the least distance to a metre before the line, by turns inside and outside
    last = track.length - START_CLEAR_M - 1e-6
    step = (last - apart) / max(1, count - 1)
    if count > 1 and step < max(apart, BOX_SPACING_M):
        raise ValueError(f"{BOXES}: {count} boxes that are {APART}={apart:g} m apart have no room on this track")
    return {"boxes": [((apart + number * step) / track.length, (INNER, OUTER)[number % 2]) for number in range(count)]}


def _places(values: Mapping[str, Any]) -> list[tuple[float, str]]:
    """The boxes of ``OBJECT_POSITIONS``: strings such as ``"0.23,-1"`` or pairs, in a list or joined by ``;``."""
    given = values[PLACES]
    if isinstance(given, str):
        given = [one for one in given.strip("[] ").split(";") if one.strip()]
    places = []
    for one in given or ():
        try:
            progress, lane = one.strip("()[] ").split(",") if isinstance(one, str) else one
            places.append((float(progress), _LANES[float(lane)]))
        except (TypeError, ValueError, KeyError, AttributeError):
            raise ValueError(
                f"{PLACES}: {one!r} is no place; write the share of the lap and the lane, 1 inside or -1 outside, such "
                "as '0.23,-1'"
            ) from None
    return places


def _flag(values: Mapping[str, Any], key: str) -> bool:
    word = str(values[key]).strip().lower()
    if word not in ("true", "false"):
        raise ValueError(f"{key} must be 'true' or 'false', not {values[key]!r}")
    return word == "true"


def _number(values: Mapping[str, Any], key: str) -> float:
    try:
        return float(str(values[key]))
    except ValueError:
        raise ValueError(f"{key} must be a number, not {values[key]!r}") from None


def _whole(values: Mapping[str, Any], key: str, most: int | None = None) -> int:
    try:
        count = int(str(values[key]))
    except ValueError:
        count = -1
    if count < 0 or (most is not None and count > most):
        raise ValueError(f"{key} must be a whole number from 0{f' to {most}' if most else ''}, not {values[key]!r}")
    return count


def _ms(values: Mapping[str, Any], key: str) -> int:
    return round(1000.0 * _number(values, key))


def _ruled(values: Mapping[str, Any], key: str, rule: str, read: Callable[[Mapping[str, Any], str], float]) -> float:
    """The value of a race rule. Raises ValueError beyond its range."""
    found = read(values, key)
    least, most = RUN_RULES[rule].bounds
    if not least <= found <= most:
        scale = 1000.0 if RUN_RULES[rule].unit == "ms" else 1.0
        raise ValueError(f"{key} must be from {least / scale:g} to {most / scale:g}, not {values[key]!r}")
    return found
