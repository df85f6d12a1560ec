"""The successor of a season: a copy by an admin, or a draft that the league's clock makes ahead of time."""

import logging
import re
import zoneinfo
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta

from django.core.exceptions import ValidationError
from django.db import DatabaseError, transaction
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.columns import copied_values
from core.events import record
from core.validators import without_invisible
from paddock.errors import UserFault
from paddock.rules.race import RULES
from races.errors import RaceRefused
from races.models import Race
from races.pages.services import add_months, free_slug
from races.rules.validation import EDITABLE_FIELDS

from ...events import SEASON_DRAFTED
from ...models import Round, Season, Stage
from ...models.season import WITH_POINTS, WORD_OF
from ...standings.services import give_fields
from ..selectors import free_season_slug
from .seasons import create_season, schedule_round, set_stage_rules

logger = logging.getLogger(__name__)
A_YEAR = 12
MOST_MONTHS = 10 * A_YEAR
LEAD = timedelta(days=60)  # so long before its first race a season is drafted
_SETTINGS = (
    *("promotion_percent", "finale_size", "championship_places", "points", "drop_worst", "steward_hours", "zone"),
    "continues",
)
_RACE_FIELDS = tuple(name for name in EDITABLE_FIELDS if name not in ("opens_at", "closes_at", "beside"))
# Promises for one season: an admin may copy them, the clock never does.
_PROMISES = ("prize", "sponsor")
# A year, or two as in 2026-27; the second one must be the following year, or it would be a month.
_YEARS = re.compile(r"(?<!\d)(20\d\d)(?:([-–/])(\d\d)(?!\d))?(?!\d)")
_LAST_NUMBER = re.compile(r"(\d{1,3})(?!.*\d)")


@dataclass(frozen=True)
class Copied:
    """A copy of a season. ``left_out``: names of the races that could not be made at their new times."""

    season: Season
    races: int
    left_out: list[str]


@audited("season.copied", _("Season copied"))
@transaction.atomic
def copy_season(
    *, season: Season, now: datetime, months: int | None = None, name: str = "", slug: str = "", promises: bool = True
) -> Copied:
    """Make the same season again, ``months`` later: by default the first whole years without overlap that are not over.

    ``name`` and ``slug``: with later years if left out. ``promises``: whether prizes and sponsors are copied. The first
    copy that begins after the season continues it: divisions are carried over. Raises UserFault("season_without_races"
    | "season_copy_months"), ValidationError by field.
    """
    season = Season.objects.select_for_update().get(pk=season.pk)
    rounds = _rounds_of(season)
    if not rounds:
        raise UserFault("season_without_races")
    if months is None:
        months = _months_ahead(season, rounds, now)
    if not 1 <= months <= MOST_MONTHS:
        raise UserFault("season_copy_months", most=MOST_MONTHS)
    zone = zone_of(season)
    left = _left_at(rounds, months, zone, now)
    if not left:
        raise UserFault("season_without_races")
    follows = not hasattr(season, "successor") and months >= _months_to_next(rounds, zone)
    name = name or later_text(without_invisible(season.name), months)
    copy = create_season(
        slug=slug or free_season_slug(later_text(season.slug, months, between="-")),
        name=name[: Season._meta.get_field("name").max_length],
        starts_on=min(_later_day(season.starts_on, months, zone), _times(left[0].race, months, zone)[0].date()),
        ends_on=_last_day(season, left, months, zone),
        prizes=without_invisible(season.prizes, lines=True) if promises else "",
        follows=season if follows else None,
        **{field: getattr(season, field) for field in _SETTINGS},
    )
    for rules in season.stage_rules.all():
        set_stage_rules(season=copy, stage=rules.stage, **rules.for_a_race())
    made, left_out = _copy_rounds(season, copy, left, months, promises, now)
    if follows:
        give_fields(season, now=now)
    return Copied(copy, made, left_out)


def continue_seasons(*, now: datetime) -> list[Season]:
    """Draft the successor of every continuing season whose next one opens within 60 days and was not made by an
    admin."""
    drafted = []
    waiting = Season.objects.filter(continues=True, successor=None, record=None, starts_on__lt=now.date())
    for season in waiting.order_by("starts_on", "pk"):
        try:
            copied = _draft(season, now)
        except (ValidationError, RaceRefused, UserFault, DatabaseError):
            logger.exception("The season after %s could not be drafted.", season.slug)
            continue
        if copied is not None:
            logger.info("Drafted %s with %s races, to follow %s.", copied.season.slug, copied.races, season.slug)
            drafted.append(copied.season)
    return drafted


def zone_of(season: Season) -> zoneinfo.ZoneInfo:
    """The time zone by whose clock a season's races open and close."""
    return zoneinfo.ZoneInfo(season.zone or timezone.get_default_timezone_name())


def later_text(text: str, months: int, *, between: str = " ") -> str:
    """A name or address with its years moved on; without a year its last number counted up, without a number with a
    2."""
    years = round(months / A_YEAR)

    def later(found: re.Match) -> str:
        first, dash, second = found.groups()
        moved = int(first) + years
        if second is None:
            return str(moved)
        if int(second) != (int(first) + 1) % 100:  # a month, such as in 2026-11
            return f"{moved}{dash}{second}"
        return f"{moved}{dash}{(moved + 1) % 100:02}"

    changed, count = _YEARS.subn(later, text)
    if count:
        return changed if years else f"{text}{between}2"
    changed, count = _LAST_NUMBER.subn(lambda found: str(int(found[0]) + 1), text)
    return changed if count else f"{text}{between}2"


def _draft(season: Season, now: datetime) -> Copied | None:
    rounds = _rounds_of(season)
    if not rounds or any(one.race.imported_at for one in rounds) or all(one.race.cancelled_at for one in rounds):
        return None
    zone = zone_of(season)
    opens = add_months(rounds[0].race.opens_at, _months_to_next(rounds, zone), zone)
    if now < opens - LEAD or _is_replaced(season, rounds, opens):
        return None
    with transaction.atomic():
        locked = Season.objects.select_for_update().get(pk=season.pk)
        if not locked.continues or Season.objects.filter(follows=locked).exists():
            return None  # another clock was here
        copied = copy_season(season=locked, now=now, promises=False)
        first = min(one.race.opens_at for one in copied.season.rounds.select_related("race"))
        record(
            SEASON_DRAFTED,
            at=now,
            subject=copied.season.slug,
            once=str(copied.season.pk),
            opens=first.isoformat(),
            before=season.name,
            left_out=len(copied.left_out),
        )
        return copied


def _is_replaced(season: Season, rounds: list[Round], opens: datetime) -> bool:
    """Whether an admin has made races of the same stages from ``opens`` on, in a later season that follows none."""
    stages = {one.stage for one in rounds if one.stage in WITH_POINTS} or {one.stage for one in rounds}
    others = Round.objects.filter(
        stage__in=stages, race__cancelled_at=None, race__imported_at=None, race__closes_at__gt=opens
    )
    others = others.exclude(season=season).filter(season__follows=None, season__starts_on__gt=season.starts_on)
    for other in set(others.values_list("season", flat=True)):
        first = Round.objects.filter(season=other, stage__in=stages, race__cancelled_at=None).order_by("race__opens_at")
        began = first.values_list("race__opens_at", flat=True).first()
        if began is not None and began > opens - LEAD:
            return True
    return False


def _rounds_of(season: Season) -> list[Round]:
    return list(season.rounds.select_related("race__track").order_by("race__opens_at", "number", "pk"))


def _with_points(rounds: Iterable[Round]) -> list[Round]:
    rounds = list(rounds)
    return [one for one in rounds if one.stage in WITH_POINTS] or rounds


def _months_to_next(rounds: list[Round], zone: zoneinfo.ZoneInfo) -> int:
    """The first whole number of years after which the races with points do not overlap with those of the season."""
    counted = _with_points(rounds)
    end, months = max(one.race.closes_at for one in counted), A_YEAR
    while add_months(counted[0].race.opens_at, months, zone) < end:
        months += A_YEAR
    return months


def _months_ahead(season: Season, rounds: list[Round], now: datetime) -> int:
    zone, counted = zone_of(season), _with_points(rounds)
    months = _months_to_next(rounds, zone)
    while all(add_months(one.race.closes_at, months, zone) <= now for one in counted):
        months += A_YEAR
    return months


def _left_at(rounds: list[Round], months: int, zone: zoneinfo.ZoneInfo, now: datetime) -> list[Round]:
    """The rounds that would not be over, without finales of pro races that would be."""
    over = {one.pk for one in rounds if _times(one.race, months, zone)[1] <= now}
    pros = {one.number: one.pk for one in rounds if one.stage == Stage.PRO}
    return [
        one for one in rounds if one.pk not in over and not (one.stage == Stage.FINALE and pros.get(one.number) in over)
    ]


def _copy_rounds(
    season: Season, copy: Season, rounds: list[Round], months: int, promises: bool, now: datetime
) -> tuple[int, list[str]]:
    zone, left_out = zone_of(season), []
    made: dict[int, Race] = {}
    # a race of real cars may stand beside a simulated one, which is made first
    for one in sorted(rounds, key=lambda one: one.race.beside_id is not None):
        race = one.race
        opens, closes = _times(race, months, zone)
        fields = copied_values(race, _RACE_FIELDS) | ({} if promises else dict.fromkeys(_PROMISES, ""))
        fields["name"] = without_invisible(race.name.replace(season.name, copy.name)[:64])
        fields["beside"], fields["seed"] = made.get(race.beside_id), _later_seed(race, months)
        try:
            with transaction.atomic():
                made[race.pk] = schedule_round(
                    season=copy,
                    number=one.number,
                    stage=one.stage,
                    month=without_invisible(one.name),
                    now=now,
                    slug=free_slug(_race_slug(one, season, copy, months)),
                    opens_at=opens,
                    closes_at=closes,
                    **fields,
                ).race
        except (RaceRefused, ValidationError):
            logger.exception("%s could not be copied into %s.", race.slug, copy.slug)
            left_out.append(race.name)
    if not made:
        raise UserFault("season_without_races")
    return len(made), left_out


def _times(race: Race, months: int, zone: zoneinfo.ZoneInfo) -> tuple[datetime, datetime]:
    """When the copy of a race opens and closes; it keeps its length where a leap day would leave none."""
    opens, closes = (add_months(moment, months, zone) for moment in (race.opens_at, race.closes_at))
    return opens, closes if closes > opens else opens + (race.closes_at - race.opens_at)


def _later_seed(race: Race, months: int) -> int:
    """Another layout each year, the same one for a pro race and its finale; a fixed layout keeps its seed."""
    drawn = race.random_boxes or race.bots
    return (race.seed + months) % ((RULES["seed"].most or 2**31) + 1) if drawn else race.seed


def _race_slug(round_: Round, season: Season, copy: Season, months: int) -> str:
    slug = round_.race.slug
    if slug.startswith(f"{season.slug}-"):
        return f"{copy.slug}{slug[len(season.slug) :]}"
    if months % A_YEAR == 0 and _YEARS.search(slug):
        return later_text(slug, months)
    return f"{copy.slug}-{round_.number:02}-{WORD_OF[Stage(round_.stage)]}"


def _later_day(day: date, months: int, zone: zoneinfo.ZoneInfo) -> date:
    return add_months(datetime.combine(day, time(12), zone), months, zone).date()


def _last_day(season: Season, rounds: list[Round], months: int, zone: zoneinfo.ZoneInfo) -> date:
    """The season's last day so much later, or the day of the last closing where that is later."""
    last = max(_times(one.race, months, zone)[1] for one in rounds) - timedelta(seconds=1)
    return max(_later_day(season.ends_on, months, zone), last.astimezone(zone).date())
