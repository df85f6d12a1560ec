"""The one place that decides whether a race makes sense: for services, forms and the admin site alike."""

from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial

from django.core.exceptions import ValidationError

from accounts.groups.selectors import may_hold_for
from core.forms import same_value
from paddock.rules.race import BOX_RULES, RULES, RUN_RULES

from ..errors import RaceRefused, problem
from ..models import Race, RaceKind, RaceState
from .layout import check_layout

MAX_DURATION = timedelta(days=366)
MAX_AHEAD = timedelta(days=2 * 366)
# A form is filled in for a while; a race that "opens now" may have opened when it is sent.
OPENING_SLACK = timedelta(hours=1)

# Of higher rooms, which add them when the site starts. Checks of changed times: ``check(race, before)`` raises
# ValidationError by field, where ``before`` is the stored race.
TIME_CHECKS: list[Callable[[Race, Race], None]] = []
# Locks before a change of a race: the data of those checks then stays unchanged.
HOLDS: list[Callable[[Race], None]] = []

# Rules with an effect on lap times or order: fixed from the first submission on.
PHYSICAL_FIELDS = ("physical", "session_s", "minimum_lap_ms")
RULE_FIELDS = ("track", *PHYSICAL_FIELDS, *(name for name, rule in RULES.items() if rule.fixed))
# The rules that decide the places of boxes and the room of bots: a change of one recomputes and checks the layout.
BOX_AND_BOT_FIELDS = ("track", "direction", "race_type", *BOX_RULES, "bots", "seed")
# Fields of a layout: boxes and bots are placed only if all of these are valid.
LAID_OUT_BY = frozenset(("track", *RUN_RULES))
# Fields fixed after creation.
FIXED_FIELDS = ("slug", "kind", "organiser", "created_at")
# Fields that may change even when a race is over.
TEXT_FIELDS = ("name", "description")
EDITABLE_FIELDS = (
    *TEXT_FIELDS,
    *RULE_FIELDS,
    "prize",
    "sponsor",
    "terms",
    "division",
    "beside",
    *(name for name, rule in RULES.items() if not rule.fixed),
    "visibility",
    "group",
    "team_entries",
    "opens_at",
    "closes_at",
)


def hold_above(race: Race) -> None:
    """Take the locks that rooms above have over a race, within a transaction."""
    for hold in HOLDS:
        hold(race)


def check_race(race: Race, *, now: datetime, before: Race | None = None, submissions: bool = False) -> None:
    """Refuse a race that makes no sense, or a forbidden change of ``before``, the stored race. Raises RaceRefused with
    every problem by field."""
    problems = ValidationError({})
    _collect(problems, race.full_clean)
    if before is None or before.group_id != race.group_id:
        _collect(problems, lambda: _check_group(race))
    _collect(problems, lambda: check_times(race, now=now, before=before, submissions=submissions))
    changed = set() if before is None else set(changed_fields(before, race))
    times = {"opens_at", "closes_at"}
    if before is not None and times & changed and not times & set(problems.error_dict):
        for check in TIME_CHECKS:
            _collect(problems, partial(check, race, before))
    if (before is None or changed & set(BOX_AND_BOT_FIELDS)) and not LAID_OUT_BY & set(problems.error_dict):
        _collect(problems, lambda: check_layout(race))
    if problems.error_dict:
        raise RaceRefused(problems)


def _check_group(race: Race) -> None:
    if race.group is not None and not may_hold_for(race.organiser, race.group):
        raise ValidationError({"group": problem("race_group_not_yours")})


def check_times(race: Race, *, now: datetime, before: Race | None = None, submissions: bool = False) -> None:
    """The checks that need the clock or the stored race; the rest is ``Race.full_clean``. Raises ValidationError."""
    problems: dict[str, ValidationError] = {}
    changed = [] if before is None else changed_fields(before, race)
    timed = isinstance(race.opens_at, datetime) and isinstance(race.closes_at, datetime)
    if timed and race.opens_at < race.closes_at:
        if race.closes_at - race.opens_at > MAX_DURATION:
            problems["closes_at"] = problem("race_too_long", days=MAX_DURATION.days)
        if race.opens_at > now + MAX_AHEAD:
            problems["opens_at"] = problem("race_too_far_ahead", days=MAX_AHEAD.days)
    state = None if before is None else before.state_at(now)
    is_over = state in (RaceState.CLOSED, RaceState.CANCELLED)
    has_closed = isinstance(race.closes_at, datetime) and race.closes_at <= now
    if before is None and has_closed:
        problems["closes_at"] = problem("race_already_over")
    elif not is_over and "closes_at" in changed and has_closed:
        problems.setdefault("closes_at", problem("race_already_over"))
    # a league's month may be scheduled after it has begun
    is_new = before is None and race.kind == RaceKind.COMMUNITY
    if (is_new or (state == RaceState.UPCOMING and "opens_at" in changed)) and _has_opened(race, now):
        problems.setdefault("opens_at", problem("race_opens_in_the_past"))
    for field in changed:
        if field in FIXED_FIELDS:
            problems[field] = problem("race_field_fixed", field=field)
        elif submissions and (field in RULE_FIELDS or field == "division"):
            problems[field] = problem("race_has_submissions")
        elif field == "opens_at" and state == RaceState.OPEN:
            problems[field] = problem("race_has_opened")
        elif is_over and field not in TEXT_FIELDS:
            problems[field] = problem("race_is_over")
    if problems:
        raise ValidationError(problems)


def _has_opened(race: Race, now: datetime) -> bool:
    return isinstance(race.opens_at, datetime) and race.opens_at < now - OPENING_SLACK


def changed_fields(before: Race, after: Race) -> list[str]:
    """Names of the fields that racers know in which two states of a race differ."""
    names = (*EDITABLE_FIELDS, *FIXED_FIELDS)
    return [name for name in names if not same_value(stored_value(before, name), stored_value(after, name))]


def stored_value(race: Race, name: str) -> object:
    """The value of a race's field; for a related row its key."""
    return getattr(race, name if name in RULES else Race._meta.get_field(name).attname)


def _collect(problems: ValidationError, check: Callable[[], None]) -> None:
    """Run ``check`` and keep the first ValidationError of each field."""
    try:
        check()
    except ValidationError as error:
        for field, errors in error.update_error_dict({}).items():
            problems.error_dict.setdefault(field, errors)
