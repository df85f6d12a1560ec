"""The demo content of a new installation: a season of twelve months with all race types, and a few community races."""

from calendar import month_name
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

from django.db import transaction
from django.utils import timezone
from django.utils.translation import gettext_lazy

from core.audit.recording import audited
from paddock.rules.race import ROUND_ROBIN_DUELS, RULES, STAGE, UNTIL_THE_FIRST_FAULT
from races.models import RaceType, RankingMethod
from races.models.sensors import OFFERABLE
from races.pages.services import add_months, create_community_race
from races.web.names import house_text as _
from tracks.models import Direction, Track
from tracks.services import load_catalogue

from ...house_cars.services import ORGANISER, house_racer
from ...models import Season, Stage
from ...models.season import WORD_OF
from .season_plan import Turn, proposed_race
from .seasons import create_season, schedule_round

MONTHS = 12
# As the form for a season proposes: a month's finale in the next one, the championship a week after the last.
FINALE_AFTER, FINALE_LASTS = timedelta(days=9, hours=18), timedelta(days=1)
CHAMPIONSHIP_AFTER, CHAMPIONSHIP_LASTS = timedelta(days=7), timedelta(days=2)
# The first month is the one that newcomers see: a fast track of middle length.
OPEN_TRACKS = ("kuei-raceway", "cosmic-loop", "baja-turnpike", "cosmic-circuit", "baja-highway", "kuei-super-raceway")
PRO_TRACKS = ("cosmic-circuit", "baja-highway", "kuei-super-raceway", "kuei-raceway", "cosmic-loop", "baja-turnpike")
# Milder penalties of crashes and more time, as the form of a season proposes.
LIMITS = {name: RULES[name].of_a_stage for name in STAGE if RULES[name].of_a_stage is not None}
# Learners' cars of the old console drive 0.5 to 1 m/s: two minutes a lap must be enough.
OPEN_RULES = {"laps": 3, "minimum_laps": 3, "off_track_penalty_ms": 3000, "max_simulated_ms": 360_000}
PRO_RULES = {
    "laps": 3,
    "minimum_laps": 3,
    "off_track_penalty_ms": 5000,
    **LIMITS,
    "sensors": list(OFFERABLE),
}
# What the pro races and their finales are by turns, as the official league's were in 2021 and 2022: boxes or bots.
PRO_TYPES = tuple(proposed_race(turn) for turn in (Turn.BOXES, Turn.BOTS))
CHAMPIONSHIP_TYPE = proposed_race(Turn.MODELS)

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
            **LIMITS,
            "ranking_method": RankingMethod.BEST,
            "laps": 3,
            "minimum_laps": 1,
            "sensors": list(OFFERABLE),
        },
    ),
    (
        3,
        {
            "name": _("Traffic on the loop"),
            "description": _("Four slow bots that change lanes. Overtake without contact."),
            "track": "cosmic-loop",
            **proposed_race(Turn.BOTS),
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
            **proposed_race(Turn.MODELS),
            **ROUND_ROBIN_DUELS,
            "ranking_method": RankingMethod.BEST,
            "laps": 3,
            "minimum_laps": 1,
            "max_simulated_ms": 360_000,
            "sensors": list(OFFERABLE),
        },
    ),
)


@audited("season.created", gettext_lazy("Season created"))
@transaction.atomic
def open_demo_season(*, now: datetime) -> Season:
    """Load the catalogue and open a season of monthly races with finales and a championship; returns an existing
    season."""
    season = Season.objects.order_by("starts_on", "pk").first()
    if season is not None:
        return season
    tracks = {track.slug: track for track in load_catalogue(now=now)}
    local = now.astimezone(timezone.get_default_timezone())
    first = local.replace(day=1, hour=0, minute=0, second=0, microsecond=0, fold=0)
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
        month=month_name[months[-2].month],
        name=f"{season.name} · championship",
        **pro,
        **CHAMPIONSHIP_TYPE,
    )
    organiser = house_racer(name="paddock", display_name=ORGANISER, now=now)
    for lasts, race in COMMUNITY_RACES:
        wanted = race | {"track": tracks[race["track"]]}
        create_community_race(organiser=organiser, now=now, opens_at=now, closes_at=add_months(now, lasts), **wanted)
    return season


def _schedule_month(
    season: Season, number: int, tracks: dict[str, Track], opens: datetime, closes: datetime, now: datetime
) -> dict[str, Any]:
    """The open race of a month, the pro race and its finale; returns where the latter two are driven."""
    month = month_name[opens.month]
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
            slug=f"{opens:%Y-%m}-{WORD_OF[stage]}",
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
