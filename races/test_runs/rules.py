"""The rules of a racer's own run: from their choices, or from a race."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from django.core.exceptions import ValidationError

from paddock.errors import UserFault
from paddock.rules.race import BOTS as AGAINST_BOTS
from paddock.rules.race import HEAD_TO_HEAD, MODELS, OWN_RULES, ROUND_ROBIN_DUELS, RULES, RaceRules
from paddock.rules.ranked import NEEDED, RANKED, usually_needed
from tracks.models import Track

from ..errors import RaceRefused, problem
from ..models import Race
from ..models.layout import problems_of
from ..models.rules import lap_problems, usual
from ..rules.layout import check_layout, race_rules

_NAMES = tuple(name for name in OWN_RULES if name in RULES)


@dataclass(frozen=True)
class OwnRules:
    """The rules of a run; ``ranked``: how its laps count, the values of :data:`paddock.rules.ranked.RANKED`."""

    rules: RaceRules
    ranked: dict[str, object]


def own_rules(track: Track, options: Mapping[str, Any], *, rivals: int = 0) -> OwnRules:
    """The rules of a run with ``options`` (names of :data:`paddock.rules.race.OWN_RULES`) and this number of rivals.

    Defaults of missing options: against rivals if there are any, else against bots if given; ranked over three laps, or
    all driven ones if fewer. Raises RaceRefused with all problems by field, UserFault
    ``race_track_without_shape``, ``own_needs_rivals``, ``rivals_...``, ``too_many_rivals``; TypeError for an option
    that no run has.
    """
    if unknown := options.keys() - OWN_RULES.keys():
        raise TypeError(f"a run has no {', '.join(sorted(unknown))}")
    if not track.has_shape:
        raise UserFault("race_track_without_shape", track=track.name)
    race = race_like(track, options, rivals=rivals)
    start_m = float(options.get("start_m") or 0.0)
    problems = _problems(race, start_m)
    if problems:
        raise RaceRefused(ValidationError(problems))
    if race.opponents == MODELS and not rivals:
        raise UserFault("own_needs_rivals")
    return OwnRules(replace(race_rules(race), start_m=start_m), _ranked(race))


def rules_as_in(race: Race) -> OwnRules:
    """The rules of a race. Raises UserFault ``race_recorded`` for one that was driven elsewhere,
    ``race_track_without_shape``."""
    if not race.track.has_shape:
        raise UserFault("race_track_without_shape", track=race.track.name)
    if race.imported_at is not None:
        raise UserFault("race_recorded")
    return OwnRules(race_rules(race), _ranked(race))


def race_like(track: Track, options: Mapping[str, Any], *, rivals: int = 0) -> Race:
    """An unsaved race with these rules, for code that takes races, such as maps and checks."""
    values = {name: options.get(name, usual(name)) for name in _NAMES}
    if values["race_type"] == HEAD_TO_HEAD and not values["opponents"]:
        values["opponents"] = MODELS if rivals else AGAINST_BOTS if values["bots"] else ""
    if NEEDED not in options and isinstance(values["laps"], int):
        values[NEEDED] = usually_needed(values["ranking_method"], values["laps"])
    # other code checks for rivals; the format of duels has no effect here
    duels = ROUND_ROBIN_DUELS if values["opponents"] == MODELS else {}
    return Race(track=track, **values, **duels)


def _ranked(race: Race) -> dict[str, object]:
    return {name: getattr(race, name) for name in RANKED}


def _problems(race: Race, start_m: float) -> dict[str, ValidationError | list[ValidationError]]:
    others = {field.name for field in Race._meta.fields} - set(_NAMES)
    problems: dict[str, ValidationError | list[ValidationError]] = {}
    try:
        race.clean_fields(exclude=others)
    except ValidationError as error:
        problems = dict(error.error_dict)
    for name, found in {**lap_problems(race), **problems_of(race)}.items():
        problems.setdefault(name, found)
    length_m = race.track.length_m or 0.0
    if not 0.0 <= start_m < length_m:
        problems["start_m"] = problem("own_start", length_m=f"{length_m:.2f}")
    elif start_m and race.track.is_open:
        problems["start_m"] = problem("track_start_fixed")
    if not problems:
        try:
            check_layout(race)
        except ValidationError as error:
            problems = dict(error.error_dict)
    return problems
