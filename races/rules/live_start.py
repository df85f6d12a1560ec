"""The rules of a live event's runs: the race's, with the event's own start and seed, so that laps of the qualifying do
not repeat."""

import secrets
from dataclasses import replace

from evaluation.models import Evaluation
from paddock.errors import UserFault
from paddock.rules.race import LIVE_LAPS, RUN_RULES, RaceRules
from paddock.simulator.layout import Layout, lay_out

from ..models import LiveEvent, Race
from .layout import race_rules

MOST_SEED = int(RUN_RULES["seed"].most or 0)
_STEP_M = 0.1
_CLEAR_SHARE = 0.05  # of a lap, on either side of the race's finish line, where no start is drawn
_ATTEMPTS = 50


def live_rules(event: LiveEvent) -> RaceRules:
    """The rules of the event's runs. Events planned without start and seed have the race's."""
    rules = race_rules(event.race)
    return replace(rules, start_m=start_m(event), seed=seed(event))


def attempt_rules(event: LiveEvent) -> RaceRules:
    return replace(live_rules(event), laps=LIVE_LAPS, max_simulated_ms=event.attempt_ms)


def start_m(event: LiveEvent) -> float:
    """Metres from the race's finish line to the line where the event's laps begin and end."""
    return event.start_m or 0.0


def seed(event: LiveEvent) -> int:
    return event.race.seed if event.seed is None else event.seed


def begins_elsewhere(evaluation: Evaluation) -> bool:
    """Whether laps of a run begin elsewhere than at the finish line, so that its sectors do not compare."""
    return bool(evaluation.spec["rules"].get("start_m"))


def live_layout(event: LiveEvent) -> Layout:
    return _layout(event.race, live_rules(event))


def draw_start(race: Race) -> float:
    """A start somewhere on the lap but near the finish line; on an open track the finish line's own."""
    if race.track.geometry.is_open:
        return 0.0
    first, last = (round(race.track.length_m * share / _STEP_M) for share in (_CLEAR_SHARE, 1 - _CLEAR_SHARE))
    return round((first + secrets.randbelow(last - first + 1)) * _STEP_M, 1)


def draw_seed(race: Race) -> int:
    """A seed whose boxes have room on the race's track."""
    rules = race_rules(race)
    for _attempt in range(_ATTEMPTS):
        drawn = secrets.randbelow(MOST_SEED + 1)
        try:
            _layout(race, replace(rules, seed=drawn))
        except UserFault:
            continue
        return drawn
    return race.seed


def check_start(race: Race, start_m: float | None, seed: int | None) -> None:
    """Refuse a start off the lap and a seed without room for its boxes. Raises UserFault."""
    length = race.track.length_m
    if start_m is not None and not 0 <= start_m < length:
        raise UserFault("live_start", length_m=f"{length:.2f}")
    if seed is not None and not 0 <= seed <= MOST_SEED:
        raise UserFault("live_format", name="seed", least=0, most=MOST_SEED)
    rules = race_rules(race)
    _layout(race, replace(rules, start_m=start_m or 0.0, seed=rules.seed if seed is None else seed))


def _layout(race: Race, rules: RaceRules) -> Layout:
    return lay_out(race.track.geometry.in_direction(rules.direction), rules)
