"""A whole season from one form: up to twelve months of open and pro races with their finales, and a championship."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.utils.dates import MONTHS
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from paddock.errors import UserFault
from paddock.rules.race import BOTS_DRIVING, DRAWN_BOXES, DUELS, LAYOUT, RULES
from races.errors import RaceRefused
from races.models import Opponents, Race, RaceKind, RaceType
from races.pages.services import free_slug
from tracks.models import Direction, Track

from ...models import Season, Stage
from ...models.season import DIVISION_OF, WORD_OF
from ...standings.services import give_fields
from .seasons import create_season, delete_season, edit_season, schedule_round, set_stage_rules

# Settings that a finale takes over from its pro race by default.
_ON_THE_TRACK = ("track", "direction", "race_type", *LAYOUT, "seed")


class Turn(models.TextChoices):
    """What is raced when it is a race type's turn; head-to-head is against bots or of cars against cars."""

    TIME_TRIAL = "time_trial", _("time trial")
    BOXES = "object_avoidance", _("object avoidance")
    BOTS = "bots", _("head-to-head against bots")
    MODELS = "models", _("head-to-head, car against car")


_TURNS: dict[str, tuple[dict[str, object], tuple[str, ...]]] = {
    Turn.TIME_TRIAL: ({"race_type": RaceType.TIME_TRIAL}, ()),
    Turn.BOXES: ({"race_type": RaceType.OBJECT_AVOIDANCE}, DRAWN_BOXES),
    Turn.BOTS: ({"race_type": RaceType.HEAD_TO_HEAD, "opponents": Opponents.BOTS}, BOTS_DRIVING),
    Turn.MODELS: ({"race_type": RaceType.HEAD_TO_HEAD, "opponents": Opponents.MODELS}, DUELS),
}


def proposed_race(turn: Turn) -> dict[str, object]:
    """The race of a turn as the form of a season proposes it, as fields of a race."""
    fields, numbers = _TURNS[turn]
    return fields | {name: RULES[name].default_of_a_stage for name in numbers}


class Turning(models.TextChoices):
    CCW = "ccw", _("all counterclockwise")
    CW = "cw", _("all clockwise")
    ALTERNATING = "alternating", _("direction alternates every month")
    HALVES = "halves", _("second half in the other direction")

    def of(self, number: int, months: int) -> str:
        """The direction of month ``number`` (from 1) of so many."""
        turned = {
            Turning.CCW: False,
            Turning.CW: True,
            Turning.ALTERNATING: number % 2 == 0,
            Turning.HALVES: number > (months + 1) // 2,
        }[self]
        return Direction.CW if turned else Direction.CCW


@dataclass(frozen=True)
class StagePlan:
    """How the races of a stage are driven.

    ``turns``: race types by turns; none: as in the month's pro race. ``layout``: boxes, bots and so on (fields of a
    race). ``sensors``: what is offered; ``rules``: fields of StageRules.
    """

    turns: Sequence[str] = (Turn.TIME_TRIAL,)
    layout: Mapping[str, Any] = field(default_factory=dict)
    sensors: Sequence[str] | None = None
    rules: Mapping[str, Any] = field(default_factory=dict)

    def fields_of(self, place: int) -> dict[str, object]:
        """What the race at this place (from 0) of the stage is, as fields of a race."""
        sensors: dict[str, object] = {} if self.sensors is None else {"sensors": list(self.sensors)}
        if not self.turns:
            return sensors
        fields, numbers = _TURNS[self.turns[place % len(self.turns)]]
        return sensors | fields | {name: self.layout[name] for name in numbers if name in self.layout}


@dataclass(frozen=True)
class MonthPlan:
    """A month's races: 1 to 12 of the season's year, 13 to 23 of the next. ``pro``: track of pro race and finale, if
    any."""

    month: int
    open: Track
    pro: Track | None
    direction: str = ""


@dataclass(frozen=True)
class RoundPlan:
    """A race before it is made. ``key``: names it in its plan; ``month``: 1 to 12; ``race``: its fields."""

    key: str
    number: int
    month: int
    stage: Stage
    slug: str
    race: dict[str, Any]

    def unsaved(self) -> Race:
        return Race(kind=RaceKind.LEAGUE, division=DIVISION_OF[self.stage], **self.race)


@dataclass(frozen=True)
class SeasonPlan:
    """A season before it is made. Times are wall-clock times of ``zone``.

    A month's finale opens on day ``finale_day`` (1 to 28) of the next month; the championship opens
    ``championship_days`` after the last finale closed, on the last month's pro track. ``settings``: fields of a season;
    ``changes``: fields of single races, by the key of their round; ``replaces``: the season that is deleted for it,
    which must not have begun.
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
    turning: Turning = Turning.CCW
    stages: Mapping[str, StagePlan] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    replaces: Season | None = None

    def at(self, month: int, day: int = 1, hour: int = 0) -> datetime:
        """A wall-clock time of the year; month 13 is January of the next."""
        return datetime(self.year + (month - 1) // 12, (month - 1) % 12 + 1, day, hour, tzinfo=self.zone)

    def slug_of(self, month: int, word: str) -> str:
        return f"{self.slug}-{(month - 1) % 12 + 1:02}-{word}"

    def rounds(self, now: datetime) -> list[RoundPlan]:
        """All races by month, the championship last, without past months. Raises UserFault("season_without_races")."""
        months = [one for one in sorted(self.months, key=lambda one: one.month) if self.at(one.month + 1) > now]
        if not months:
            raise UserFault("season_without_races")
        return list(self._rounds(months))

    def _rounds(self, months: Sequence[MonthPlan]) -> Iterator[RoundPlan]:
        pros: list[tuple[int, MonthPlan, RoundPlan]] = []
        ends: list[datetime] = []
        for number, one in enumerate(months, start=1):
            direction = one.direction or self.turning.of(number, len(months))
            times = {"opens_at": self.at(one.month), "closes_at": self.at(one.month + 1)}
            base = {"direction": direction, **times}
            yield self._round(number, one, Stage.OPEN, number - 1, base | {"track": one.open})
            if one.pro is None:
                continue
            pro = self._round(number, one, Stage.PRO, len(pros), base | {"track": one.pro})
            yield pro
            opens = self.at(one.month + 1, self.finale_day, self.finale_hour)
            times = {"opens_at": opens, "closes_at": opens + timedelta(hours=self.finale_hours)}
            finale = self._round(number, one, Stage.FINALE, len(pros), _on_the_track(pro) | times)
            yield finale
            pros.append((number, one, pro))
            ends.append(finale.race["closes_at"])
        if pros:
            _number, one, pro = pros[-1]
            opens = max(ends) + timedelta(days=self.championship_days)
            times = {"opens_at": opens, "closes_at": opens + timedelta(hours=self.championship_hours)}
            yield self._round(len(months), one, Stage.CHAMPIONSHIP, 0, _on_the_track(pro) | times)

    def _round(self, number: int, one: MonthPlan, stage: Stage, place: int, race: dict[str, Any]) -> RoundPlan:
        word, month = WORD_OF[stage], (one.month - 1) % 12 + 1
        plan = self.stages.get(stage, StagePlan())
        own = plan.fields_of(place)
        if "race_type" in own:  # nothing that its pro race has on the track; every month draws anew
            race = {name: value for name, value in race.items() if name not in (*LAYOUT, "seed")}
            own |= {} if own["race_type"] == RaceType.TIME_TRIAL else {"seed": number}
        whole = stage == Stage.CHAMPIONSHIP
        key = word if whole else f"{one.month}-{word}"
        race = {**race, **own, **plan.rules, **self.changes.get(key, {})}
        usual = f"{self.name} · {word}" if whole else f"{MONTHS[month]} {word} · {race['track'].name}"
        race = {"name": usual[:64]} | race
        slug = f"{self.slug}-championship" if whole else self.slug_of(one.month, word)
        return RoundPlan(key, number, month, stage, slug, race)


@dataclass(frozen=True)
class Previewed:
    """A race of a plan as it would be, and the sentences that say why it cannot be so."""

    plan: RoundPlan
    race: Race
    problems: list[str]


def digest_of(rounds: Sequence[RoundPlan]) -> str:
    """What stands in the races of a plan, in 16 characters: another after every change."""
    content = [(one.key, one.number, sorted((k, _plain(v)) for k, v in one.race.items())) for one in rounds]
    return hashlib.sha256(repr(content).encode()).hexdigest()[:16]


@audited("season.created", _("Season created"))
@transaction.atomic
def schedule_season(*, plan: SeasonPlan, now: datetime) -> tuple[Season, int]:
    """Make the season and all its races at once, without past months; returns it and the number of races.

    Raises RaceRefused, ValidationError, UserFault("season_without_races"), or as for deleting a season.
    """
    rounds = plan.rounds(now)
    season = _make_season(plan, rounds, now)
    for one in rounds:
        _schedule(season, one, now)
    return season, len(rounds)


def preview_season(*, plan: SeasonPlan, now: datetime) -> list[Previewed]:
    """All races as they would be made; nothing is. Raises ValidationError, UserFault("season_without_races")."""
    rounds = plan.rounds(now)
    shown = []
    with transaction.atomic():
        season = _make_season(plan, rounds, now)
        for one in rounds:
            try:
                with transaction.atomic():
                    race, problems = _schedule(season, one, now), []
            except (RaceRefused, ValidationError) as refused:
                race, problems = one.unsaved(), _sentences(refused)
            shown.append(Previewed(one, race, problems))
        transaction.set_rollback(True)
    return shown


def _make_season(plan: SeasonPlan, rounds: Sequence[RoundPlan], now: datetime) -> Season:
    before = None
    if plan.replaces is not None:
        before = plan.replaces.follows
        delete_season(season=plan.replaces, now=now)
    last = max(one.race["closes_at"] for one in rounds).astimezone(plan.zone)
    season = create_season(
        slug=plan.slug,
        name=plan.name,
        starts_on=min(one.race["opens_at"] for one in rounds).astimezone(plan.zone).date(),
        ends_on=(last - timedelta(seconds=1)).date(),
        follows=before,
        **{"zone": plan.zone.key, **plan.settings},
    )
    for stage, one in plan.stages.items():
        if one.rules:
            set_stage_rules(season=season, stage=stage, **one.rules)
    if before is not None:
        edit_season(season=before, continues=True)
        give_fields(before, now=now)
    return season


def _schedule(season: Season, one: RoundPlan, now: datetime) -> Race:
    return schedule_round(
        season=season,
        number=one.number,
        stage=one.stage,
        month=str(MONTHS[one.month]),
        now=now,
        slug=free_slug(one.slug),
        **one.race,
    ).race


def _on_the_track(pro: RoundPlan) -> dict[str, object]:
    return {name: pro.race[name] for name in _ON_THE_TRACK if name in pro.race}


def _plain(value: Any) -> str:
    return repr(value.pk if isinstance(value, Track) else value)


def _sentences(refused: RaceRefused | ValidationError) -> list[str]:
    errors = refused.errors if isinstance(refused, RaceRefused) else refused
    return list(dict.fromkeys(errors.messages))
