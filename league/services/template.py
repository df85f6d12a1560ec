"""A whole season from one form: twelve months of open and pro races with their finales, and a championship."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

from django.db import transaction
from django.utils.dates import MONTHS

from faults import UserFault
from races.models import Race
from races.services.races import free_slug
from tracks.models import Track

from ..models import Season, Stage
from .seasons import create_season, schedule_round, set_stage_rules


@dataclass(frozen=True)
class MonthPlan:
    """What is raced in a month (1 to 12). ``pro``: the pro race's and the finale's track, None for no pro races."""

    month: int
    open: Track
    pro: Track | None
    direction: str


@dataclass(frozen=True)
class SeasonPlan:
    """A season before it is made. Times are wall-clock times of ``zone``.

    An open and a pro race last from the first of their month to the first of the next. A month's finale opens on day
    ``finale_day`` (1 to 28) of the next month at ``finale_hour`` (0 to 23) for ``finale_hours``; the championship opens
    ``championship_days`` after the last finale closed, for ``championship_hours``, on the last month's pro track.
    ``rules``: fields of a race by stage; ``settings``: fields of a season.
    """

    slug: str
    name: str
    year: int
    zone: ZoneInfo
    months: Sequence[MonthPlan]
    finale_day: int = 10
    finale_hour: int = 18
    finale_hours: int = 24
    championship_days: int = 7
    championship_hours: int = 48
    rules: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)

    def at(self, month: int, day: int = 1, hour: int = 0) -> datetime:
        """A wall-clock time of the year; month 13 is January of the next."""
        return datetime(self.year + (month - 1) // 12, (month - 1) % 12 + 1, day, hour, tzinfo=self.zone)


@transaction.atomic
def schedule_season(*, plan: SeasonPlan, now: datetime) -> tuple[Season, int]:
    """Make the season and all its races at once, or nothing; returns it and how many races there are.

    Months that are over at ``now`` are left out. Raises RaceRefused, ValidationError, and UserFault
    "season_without_races" if no month is left.
    """
    months = [one for one in sorted(plan.months, key=lambda one: one.month) if plan.at(one.month + 1) > now]
    if not months:
        raise UserFault("season_without_races")
    with_pro = [one for one in months if one.pro is not None]
    finale_ends = {one.month: _finale(plan, one)[1] for one in with_pro}
    last = plan.at(months[-1].month + 1)
    if with_pro:
        opens = max(finale_ends.values()) + timedelta(days=plan.championship_days)
        championship = opens, opens + timedelta(hours=plan.championship_hours)
        last = max(last, championship[1])
    season = create_season(
        slug=plan.slug,
        name=plan.name,
        starts_on=plan.at(months[0].month).date(),
        ends_on=(last - timedelta(seconds=1)).date(),
        **plan.settings,
    )
    for stage, rules in plan.rules.items():
        set_stage_rules(season=season, stage=stage, **rules)
    count = sum(_month(season, plan, number, one, now) for number, one in enumerate(months, start=1))
    if with_pro:
        final = with_pro[-1]
        times = {"opens_at": championship[0], "closes_at": championship[1]}
        _race(season, plan, len(months), final, Stage.CHAMPIONSHIP, final.pro, times, now)
        count += 1
    return season, count


def _finale(plan: SeasonPlan, one: MonthPlan) -> tuple[datetime, datetime]:
    opens = plan.at(one.month + 1, plan.finale_day, plan.finale_hour)
    return opens, opens + timedelta(hours=plan.finale_hours)


def _month(season: Season, plan: SeasonPlan, number: int, one: MonthPlan, now: datetime) -> int:
    times = {"opens_at": plan.at(one.month), "closes_at": plan.at(one.month + 1)}
    _race(season, plan, number, one, Stage.OPEN, one.open, times, now)
    if one.pro is None:
        return 1
    _race(season, plan, number, one, Stage.PRO, one.pro, times, now)
    opens, closes = _finale(plan, one)
    _race(season, plan, number, one, Stage.FINALE, one.pro, {"opens_at": opens, "closes_at": closes}, now)
    return 3


WORDS = {Stage.OPEN: "open", Stage.PRO: "pro", Stage.FINALE: "finale", Stage.CHAMPIONSHIP: "championship"}


def _race(
    season: Season,
    plan: SeasonPlan,
    number: int,
    one: MonthPlan,
    stage: Stage,
    track: Track,
    times: dict[str, datetime],
    now: datetime,
) -> Race:
    word, month = WORDS[stage], str(MONTHS[one.month])
    whole = stage == Stage.CHAMPIONSHIP
    return schedule_round(
        season=season,
        number=number,
        stage=stage,
        month=month,
        now=now,
        slug=free_slug(f"{plan.slug}-championship" if whole else f"{plan.slug}-{one.month:02}-{word}"),
        name=f"{season.name} · {word}"[:64] if whole else f"{month} {word} · {track.name}"[:64],
        track=track,
        direction=one.direction,
        **times,
    ).race
