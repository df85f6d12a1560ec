"""The race of a command: one of this site, or rules from options, with the same errors as the forms and the API."""

import math
from argparse import ArgumentParser
from difflib import get_close_matches
from typing import Any, NamedTuple

from core.management.base import Refusal
from core.management.light import load_apps
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue.names import NEAREST
from paddock.rules.race import (
    BOT_SPEED_RANGE_MPS,
    HEAD_TO_HEAD,
    LANES,
    MAX_BOTS,
    MAX_BOXES,
    OBJECT_AVOIDANCE,
    OWN_RULES,
    RULES,
    RUN_RULES,
    BoxPlace,
    RaceRules,
)
from paddock.rules.ranked import NEEDED, RANKED, contradiction, usually_needed
from paddock.rules.rule import Rule
from races.boards.ranking import laps_needed
from tracks.management.track_lookup import FoundTrack, has_database

_METAVARS = {"ms": "SECONDS", "m": "METRES", "m/s": "MPS"}
_ASKED = [rule for rule in OWN_RULES.values() if rule.name in RUN_RULES and rule.name != "boxes"]


def add_race_options(parser: ArgumentParser) -> None:
    """The options that :func:`rules_of` reads: one for each rule of a run, None by default."""
    for rule in _ASKED:
        text = (rule.help or rule.label).rstrip(".")
        option = _flag(_option(rule))
        if rule.type is bool:
            parser.add_argument(option, action="store_true", default=None, help=text)
        elif rule.choices:
            parser.add_argument(option, choices=rule.choices, help=f"default: {rule.default}")
        else:
            shown = rule.default / 1000 if rule.unit == "ms" else rule.default
            parser.add_argument(
                option,
                type=int if rule.type is int and rule.unit != "ms" else float,
                metavar=_METAVARS.get(rule.unit, "N"),
                help=f"{text}; default: {shown}",
            )
    parser.add_argument(
        "--box",
        action="append",
        default=[],
        metavar="FRACTION:LANE",
        help=f"a box in a fixed place: the share of the lap driven there and the lane ({', '.join(LANES)}); repeat it",
    )


def add_ranking_options(parser: ArgumentParser) -> None:
    """The ranking: its method and the required laps in a row."""
    method, needed = (OWN_RULES[name] for name in RANKED)
    usual = f"default: {needed.default}, or as many as are driven"
    parser.add_argument(_flag(method.name), choices=method.choices, help=f"default: {method.default}")
    parser.add_argument(_flag(needed.name), type=int, metavar="N", help=f"{needed.label.lower()}; {usual}")


def ranking_of(options: dict[str, Any]) -> tuple[str, int]:
    """The ranking method and the laps needed. Raises UserFault("race_minimum_laps", "race_total_needs_all_laps")."""
    method = options["ranking_method"] or OWN_RULES["ranking_method"].default
    laps = RULES["laps"].default if options["laps"] is None else options["laps"]
    needed = options[NEEDED]
    if needed is None:
        return method, usually_needed(method, laps)
    if code := contradiction(method, laps, needed):
        raise UserFault(code, laps=laps)
    return method, needed


def options_given(options: dict[str, object]) -> list[str]:
    """The given options, by their command line names."""
    names = [*map(_option, _ASKED), *RANKED, "box"]
    return [_flag(name) for name in names if options[name] not in (None, [])]


def check_start(rules: RaceRules, length_m: float) -> None:
    """Raise UserFault("own_start") unless the run starts on the lap."""
    if not 0.0 <= rules.start_m < length_m:
        raise UserFault("own_start", length_m=f"{length_m:.2f}")


def rules_of(options: dict[str, Any]) -> RaceRules:
    """The rules that the options name. Raises UserFault for boxes and bots that cannot be, Refusal otherwise."""
    boxes = _boxes(options)
    _check_bots(options)
    try:
        return RaceRules(boxes=boxes, **{rule.name: _value(rule, options) for rule in _ASKED})
    except ValueError as error:
        raise Refusal(UserFault("rules_senseless", problem=str(error))) from error


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _option(rule: Rule) -> str:
    return (rule.option or rule.name.removesuffix("_ms")).replace("-", "_")


def _value(rule: Rule, options: dict[str, Any]) -> Any:
    name = _option(rule)
    value = options[name]
    if value is None or rule.unit != "ms":
        return rule.default if value is None else value
    if not math.isfinite(value):
        raise ValueError(f"{name} must be a number of seconds, not {value}")
    return round(value * 1000)


def _boxes(options: dict[str, Any]) -> tuple[BoxPlace, ...]:
    places, drawn = options["box"], options["obstacles"] or 0
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
    elif not 0 <= (options["bots"] or 0) <= MAX_BOTS or (described and not options["bots"]):
        raise UserFault("race_bot_count", most=MAX_BOTS)
    least, most = BOT_SPEED_RANGE_MPS
    speed = RaceRules.bot_speed_mps if options["bot_speed"] is None else options["bot_speed"]
    if not least <= speed <= most:
        raise UserFault("race_bot_speed", least=f"{least:g}", most=f"{most:g}")


class FoundRace(NamedTuple):
    """The rules of a race's runs and its ranking: method and laps in a row."""

    track: FoundTrack
    rules: RaceRules
    ranking_method: str
    laps_needed: int


def find_race(name: str) -> FoundRace:
    """The race of any visibility by its URL or slug. Raises Refusal of ``race_not_found`` or ``database_not_ready``,
    and UserFault for a track without a shape."""
    if not has_database():
        raise Refusal(PlatformFault("database_not_ready", problem="there is no database yet"))
    load_apps()
    from races.models import Race
    from races.rules.layout import race_rules

    slug = name.partition("?")[0].partition("#")[0].rstrip("/").rpartition("/races/")[2].partition("/")[0]
    race = Race.objects.select_related("track").filter(slug=slug).first() if "\0" not in slug else None
    if race is None:
        known = list(Race.objects.values_list("slug", flat=True))
        nearest = get_close_matches(slug, known, n=NEAREST, cutoff=0)
        raise Refusal(UserFault("race_not_found", name=name, nearest=", ".join(nearest) or "-"))
    track = FoundTrack(race.track.geometry, race.track.look)
    return FoundRace(track, race_rules(race), race.ranking_method, laps_needed(race))
