"""The demo content of a new installation: a season of twelve months with all race types, and a few community races."""

from calendar import month_name
from datetime import datetime
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
from .season_plan import MonthPlan, SeasonPlan, StagePlan, Turn, proposed_race, schedule_season

MONTHS = 12
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
_PROPOSED = proposed_race(Turn.BOXES) | proposed_race(Turn.BOTS) | proposed_race(Turn.MODELS)
STAGES: dict[str, StagePlan] = {
    Stage.OPEN: StagePlan(),
    # by turns, as the official league's were in 2021 and 2022
    Stage.PRO: StagePlan((Turn.BOXES, Turn.BOTS), _PROPOSED),
    Stage.FINALE: StagePlan(()),
    Stage.CHAMPIONSHIP: StagePlan((Turn.MODELS,), _PROPOSED),
}

_ONE_LAP = {"ranking_method": RankingMethod.BEST, "laps": 3, "minimum_laps": 1}
# The house's own races, and for how many months.
COMMUNITY_RACES: tuple[dict[str, Any], ...] = (
    {
        "months": 12,
        "name": _("First laps on the oval"),
        "description": _("For a first car: a short track, one complete lap is enough."),
        "track": "oval",
        **_ONE_LAP,
        "off_track_penalty_ms": 2000,
        # newcomers try it with the same cars, the site's own among them
        "shared_cars": True,
    },
    {
        "months": 3,
        "name": _("Turnpike three laps"),
        "description": _("Three laps, and all count: for cars that stay on the road."),
        "track": "baja-turnpike",
        "ranking_method": RankingMethod.TOTAL,
        "laps": 3,
        "minimum_laps": 3,
        "direction": Direction.CW,
    },
    {
        "months": 2,
        "name": _("No second chance"),
        "description": _("The first fault ends the run. The best two consecutive laps of ten count."),
        "track": "cosmic-loop",
        "ranking_method": RankingMethod.AVERAGE,
        "laps": 10,
        "minimum_laps": 2,
        **UNTIL_THE_FIRST_FAULT,
        "max_simulated_ms": 900_000,
    },
    {
        "months": 12,
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
        **_ONE_LAP,
        "sensors": list(OFFERABLE),
    },
    {
        "months": 3,
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
    {
        "months": 1,
        "name": _("Duels on the turnpike"),
        "description": _(
            "Qualify alone. When the race has closed, the best cars meet in a round robin of two-car duels."
        ),
        "track": "baja-turnpike",
        **proposed_race(Turn.MODELS),
        **ROUND_ROBIN_DUELS,
        **_ONE_LAP,
        "max_simulated_ms": 360_000,
        "sensors": list(OFFERABLE),
    },
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
    season, _races = schedule_season(plan=_plan(now, tracks), now=now)
    organiser = house_racer(name="paddock", display_name=ORGANISER, now=now)
    for race in COMMUNITY_RACES:
        wanted = race | {"track": tracks[race["track"]], "opens_at": now, "closes_at": add_months(now, race["months"])}
        del wanted["months"]
        create_community_race(organiser=organiser, now=now, **wanted)
    return season


def _plan(now: datetime, tracks: dict[str, Track]) -> SeasonPlan:
    """Every finale in the next month and the championship a week after the last, as the form of a season proposes."""
    zone = timezone.get_default_timezone()
    first = now.astimezone(zone)
    months, changes = [], {"championship": PRO_RULES}
    for number in range(MONTHS):
        month, opening = first.month + number, tracks[OPEN_TRACKS[number % len(OPEN_TRACKS)]]
        # half a year later every track comes back the other way round
        direction = Direction.CW if number // len(OPEN_TRACKS) % 2 else Direction.CCW
        months.append(MonthPlan(month, opening, tracks[PRO_TRACKS[number % len(PRO_TRACKS)]], direction))
        name = f"{month_name[(month - 1) % 12 + 1]} · {opening.name}"
        changes |= {f"{month}-open": OPEN_RULES | {"name": name}}
        changes |= {f"{month}-{word}": PRO_RULES for word in ("pro", "finale")}
    last = (first.month + MONTHS - 2) // 12
    years = f"{first.year}-{(first.year + last) % 100:02}" if last else f"{first.year}"
    return _Plan(
        years, f"Season {years}", first.year, zone, months, stages=STAGES, changes=changes, settings={"zone": ""}
    )


class _Plan(SeasonPlan):
    def slug_of(self, month: int, word: str) -> str:
        """The month of the year, also where the season spans two."""
        return f"{self.at(month):%Y-%m}-{word}"
