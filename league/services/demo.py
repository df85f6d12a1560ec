"""What a fresh installation races: a season of twelve months with races of every type, and a few community races of the
house."""

from __future__ import annotations

import logging
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

from django.db import transaction
from django.utils import timezone

from paddock.rules.race import UNTIL_THE_FIRST_FAULT
from races.models import DuelFormat, Opponents, RaceType, RankingMethod
from races.names import house_text as _
from races.sensors import OFFERABLE
from races.services import create_community_race
from races.services.races import add_months
from tracks.models import Direction, Track
from tracks.services import load_catalogue

from ..models import Season, Stage
from .house import ORGANISER, house_racer
from .seasons import create_season, schedule_round

logger = logging.getLogger(__name__)
MONTHS = 12
# As the form for a season proposes: a month's finale in the next one, the championship a week after the last.
FINALE_AFTER, FINALE_LASTS = timedelta(days=9, hours=18), timedelta(days=1)
CHAMPIONSHIP_AFTER, CHAMPIONSHIP_LASTS = timedelta(days=7), timedelta(days=2)
MONTH_NAMES = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)
# The first month is the one that newcomers see: a fast track of middle length.
OPEN_TRACKS = ("kuei-raceway", "cosmic-loop", "baja-turnpike", "cosmic-circuit", "baja-highway", "kuei-super-raceway")
PRO_TRACKS = ("cosmic-circuit", "baja-highway", "kuei-super-raceway", "kuei-raceway", "cosmic-loop", "baja-turnpike")
SLUGS = {Stage.OPEN: "open", Stage.PRO: "pro", Stage.FINALE: "finale"}
# Learners' cars of the old console drive 0.5 to 1 m/s: two minutes a lap must be enough.
OPEN_RULES = {"laps": 3, "minimum_laps": 3, "off_track_penalty_ms": 3000, "max_simulated_ms": 360_000}
PRO_RULES = {
    "laps": 3,
    "minimum_laps": 3,
    "off_track_penalty_ms": 5000,
    "collision_penalty_ms": 3000,
    "max_simulated_ms": 360_000,
    "sensors": list(OFFERABLE),
}
# What the pro races and their finales are by turns, as the official league's were in 2021 and 2022: boxes or bots.
PRO_TYPES: tuple[dict[str, Any], ...] = (
    {"race_type": RaceType.OBJECT_AVOIDANCE, "random_boxes": 4},
    {
        "race_type": RaceType.HEAD_TO_HEAD,
        "opponents": Opponents.BOTS,
        "bots": 4,
        "bot_speed_mps": 1.0,
        "bot_lane_changes": True,
    },
)
CHAMPIONSHIP_TYPE: dict[str, Any] = {
    "race_type": RaceType.HEAD_TO_HEAD,
    "opponents": Opponents.MODELS,
    "duel_format": DuelFormat.BRACKET,
    "duel_cars": 2,
}

# The house's own races: for how many months, and what.
COMMUNITY_RACES: tuple[tuple[int, dict[str, Any]], ...] = (
    (
        12,
        {
            "name": _("First laps on the oval"),
            "description": _("For a first car: a short track, one complete lap is enough."),
            "track": "oval",
            "ranking_method": RankingMethod.BEST,
            "laps": 3,
            "minimum_laps": 1,
            "off_track_penalty_ms": 2000,
            # newcomers try it with the same cars, the site's own among them
            "shared_cars": True,
        },
    ),
    (
        3,
        {
            "name": _("Turnpike three laps"),
            "description": _("Three laps, and all count: for cars that stay on the road."),
            "track": "baja-turnpike",
            "ranking_method": RankingMethod.TOTAL,
            "laps": 3,
            "minimum_laps": 3,
            "direction": Direction.CW,
        },
    ),
    (
        2,
        {
            "name": _("No second chance"),
            "description": _("The first fault ends the run. The best two consecutive laps of ten count."),
            "track": "cosmic-loop",
            "ranking_method": RankingMethod.AVERAGE,
            "laps": 10,
            "minimum_laps": 2,
            **UNTIL_THE_FIRST_FAULT,
            "max_simulated_ms": 900_000,
        },
    ),
    (
        12,
        {
            "name": _("Boxes on the oval"),
            "description": _("Three boxes on the road. One complete lap is enough; a crash costs three seconds."),
            "track": "oval",
            "race_type": RaceType.OBJECT_AVOIDANCE,
            "boxes": [
                {"fraction": 0.2, "lane": "outer"},
                {"fraction": 0.5, "lane": "inner"},
                {"fraction": 0.8, "lane": "outer"},
            ],
            "collision_penalty_ms": 3000,
            "ranking_method": RankingMethod.BEST,
            "laps": 3,
            "minimum_laps": 1,
            "max_simulated_ms": 360_000,
            "sensors": list(OFFERABLE),
        },
    ),
    (
        3,
        {
            "name": _("Traffic on the loop"),
            "description": _("Four slow bots that change lanes. Overtake without contact."),
            "track": "cosmic-loop",
            "race_type": RaceType.HEAD_TO_HEAD,
            "opponents": Opponents.BOTS,
            "bots": 4,
            "bot_speed_mps": 1.0,
            "bot_lane_changes": True,
            "ranking_method": RankingMethod.AVERAGE,
            "laps": 3,
            "minimum_laps": 2,
            "max_simulated_ms": 360_000,
            "sensors": list(OFFERABLE),
        },
    ),
    (
        1,
        {
            "name": _("Duels on the turnpike"),
            "description": _(
                "Qualify alone. When the race has closed, the best cars meet in a round robin of two-car duels."
            ),
            "track": "baja-turnpike",
            "race_type": RaceType.HEAD_TO_HEAD,
            "opponents": Opponents.MODELS,
            "duel_format": DuelFormat.ROUND_ROBIN,
            "duel_cars": 2,
            "ranking_method": RankingMethod.BEST,
            "laps": 3,
            "minimum_laps": 1,
            "max_simulated_ms": 360_000,
            "sensors": list(OFFERABLE),
        },
    ),
)


@transaction.atomic
def open_demo_season(*, now: datetime) -> Season:
    """Load the catalogue and open a season of monthly races, the first of them this month's, with their finales and a
    championship. Doing it again changes nothing: where there is a season already, it is returned as it is.

    The house cars come with :func:`league.services.enter_house_cars` once a worker is there to run them.
    """
    season = Season.objects.order_by("starts_on", "pk").first()
    if season is not None:
        return season
    tracks = {track.slug: track for track in load_catalogue(now=now)}
    first = _start_of_month(now)
    months = [add_months(first, month) for month in range(MONTHS + 1)]
    last_day = (months[-1] - timedelta(days=1)).date()
    years = f"{first.year}" if first.year == last_day.year else f"{first.year}-{last_day.year % 100:02}"
    crowned = months[-1] + FINALE_AFTER + FINALE_LASTS + CHAMPIONSHIP_AFTER
    season = create_season(
        slug=years,
        name=f"Season {years}",
        starts_on=first.date(),
        ends_on=(crowned + CHAMPIONSHIP_LASTS).date(),
    )
    for number, (opens, closes) in enumerate(pairwise(months), start=1):
        pro = _schedule_month(season, number, tracks, opens, closes, now)
    _schedule(
        season,
        MONTHS,
        Stage.CHAMPIONSHIP,
        (crowned, crowned + CHAMPIONSHIP_LASTS),
        now,
        slug=f"{years}-championship",
        month=MONTH_NAMES[months[-2].month - 1],
        name=f"{season.name} · championship",
        **pro,
        **CHAMPIONSHIP_TYPE,
    )
    _community_races(tracks, now)
    logger.info("Opened %s with %s months of races.", season, MONTHS)
    return season


def _schedule_month(
    season: Season, number: int, tracks: dict[str, Track], opens: datetime, closes: datetime, now: datetime
) -> dict[str, Any]:
    """The open race of a month, the pro race and its finale; returns where the latter two are driven."""
    month = MONTH_NAMES[opens.month - 1]
    # half a year later every track comes back the other way round
    turned = (number - 1) // len(OPEN_TRACKS) % 2 == 1
    direction = Direction.CW if turned else Direction.CCW
    finale = closes + FINALE_AFTER, closes + FINALE_AFTER + FINALE_LASTS
    pro_track = tracks[PRO_TRACKS[(number - 1) % len(PRO_TRACKS)]]
    pro_type = PRO_TYPES[(number - 1) % len(PRO_TYPES)] | {"seed": number}
    for stage, times, track, title in (
        (Stage.OPEN, (opens, closes), tracks[OPEN_TRACKS[(number - 1) % len(OPEN_TRACKS)]], month),
        (Stage.PRO, (opens, closes), pro_track, f"{month} pro"),
        (Stage.FINALE, finale, pro_track, f"{month} finale"),
    ):
        _schedule(
            season,
            number,
            stage,
            times,
            now,
            slug=f"{opens:%Y-%m}-{SLUGS[stage]}",
            month=month,
            name=f"{title} · {track.name}",
            track=track,
            direction=direction,
            **({} if stage == Stage.OPEN else pro_type),
        )
    return {"track": pro_track, "direction": direction}


def _schedule(
    season: Season, number: int, stage: Stage, times: tuple[datetime, datetime], now: datetime, **race: Any
) -> None:
    rules = OPEN_RULES if stage == Stage.OPEN else PRO_RULES
    opens, closes = times
    schedule_round(
        season=season, number=number, stage=stage, now=now, opens_at=opens, closes_at=closes, **rules, **race
    )


def _community_races(tracks: dict[str, Track], now: datetime) -> None:
    organiser = house_racer(name="paddock", display_name=ORGANISER, now=now)
    for months, race in COMMUNITY_RACES:
        wanted = race | {"track": tracks[race["track"]]}
        create_community_race(organiser=organiser, now=now, opens_at=now, closes_at=add_months(now, months), **wanted)


def _start_of_month(now: datetime) -> datetime:
    local = now.astimezone(timezone.get_default_timezone())
    return local.replace(day=1, hour=0, minute=0, second=0, microsecond=0, fold=0)
