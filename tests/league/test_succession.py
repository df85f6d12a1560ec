"""Seasons that follow each other: copied by hand, or drafted by the clock."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from django.core.exceptions import ValidationError

from accounts.models import Racer
from core.events import Event, follow
from league.models import Membership, Notice, Round, Season, Stage
from league.seasons.services.clock import tick
from league.seasons.services.demo_season import open_demo_season
from league.seasons.services.seasons import create_season, edit_season, put_in_division, schedule_round, set_stage_rules
from league.seasons.services.succession import LEAD, copy_season, later_text
from league.standings.services import give_fields
from league.stewarding.official_results import close_due_rounds, close_round
from paddock.errors import UserFault
from races.models import Division, Race, RaceState
from races.pages.services import add_months, cancel_race
from tests.factories import a_racer, a_track
from tests.league.seasons import JANUARY, a_round, a_season, after, board, racers
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db
A_DAY = timedelta(days=1)


def league_races(at: datetime, division: str) -> list[Race]:
    races = Race.objects.filter(kind="league", division=division, round__stage__in=[Stage.OPEN, Stage.PRO])
    return [race for race in races if race.state_at(at) == RaceState.OPEN]


def successor_of(season: Season) -> Season | None:
    return Season.objects.filter(follows=season).first()


def of_months(*months: int, year: int = 2027, slug: str = "2027", **settings) -> Season:
    """A season of open races, each from the first of its month to the first of the next."""
    season = create_season(
        slug=slug, name=f"Season {slug}", starts_on=date(year, 1, 1), ends_on=date(year, 12, 31), **settings
    )
    for number, month in enumerate(months, start=1):
        opens = datetime(year, month, 1, tzinfo=UTC)
        closes = datetime(year + month // 12, month % 12 + 1, 1, tzinfo=UTC)
        schedule_round(
            season=season,
            number=number,
            stage=Stage.OPEN,
            now=opens - A_DAY,
            opens_at=opens,
            closes_at=closes,
            track=a_track(),
            name=f"Month {month}",
        )
    return season


@pytest.mark.slow
def test_an_untouched_site_has_an_open_and_a_pro_race_in_each_of_36_months(now):
    open_demo_season(now=now)
    months = [add_months(datetime(2026, 12, 1, tzinfo=UTC), month) for month in range(36)]
    for day in (month.replace(day=number, hour=hour) for month in months for number, hour in ((1, 0), (28, 23))):
        tick(now=day)
        close_due_rounds(now=day)
        open_demo_season(now=day)
        assert len(league_races(day, Division.OPEN)) == 1, day
        assert len(league_races(day, Division.PRO)) == 1, day
    assert list(Season.objects.order_by("starts_on").values_list("slug", "name")) == [
        (slug, f"Season {slug}") for slug in ("2026-27", "2027-28", "2028-29", "2029-30")
    ]
    for season in Season.objects.all():
        stages = list(season.rounds.values_list("stage", flat=True))
        assert [stages.count(one) for one in (Stage.OPEN, Stage.PRO, Stage.FINALE, Stage.CHAMPIONSHIP)] == [
            12,
            12,
            12,
            1,
        ]
    second = Season.objects.get(slug="2027-28")
    assert (second.starts_on, second.ends_on) == (date(2027, 11, 1), date(2028, 11, 20))
    assert second.rounds.get(stage=Stage.CHAMPIONSHIP).race.name == "Season 2027-28 · championship"
    assert set(Race.objects.filter(round__season=second).values_list("slug", flat=True)) > {
        "2027-11-open",
        "2028-10-pro",
    }
    seeds = {Race.objects.get(slug=f"{year}-12-pro").seed for year in (2026, 2027, 2028)}
    assert len(seeds) == 3, "each year draws other layouts"
    assert Race.objects.get(slug="2027-12-pro").seed == Race.objects.get(slug="2027-12-finale").seed


def test_the_successor_is_drafted_60_days_ahead_and_admins_are_notified():
    admin, helper = Racer.objects.create_superuser("boss", "boss@example.org", None), a_racer("helper", is_staff=True)
    season = of_months(1, 2, 12)
    opens = datetime(2028, 1, 1, tzinfo=UTC)
    assert tick(now=opens - LEAD - A_DAY) == 0 and successor_of(season) is None
    tick(now=opens - LEAD)
    copy = successor_of(season)
    assert copy is not None and (copy.slug, copy.name) == ("2028", "Season 2028")
    follow("notices", now=opens - LEAD)
    told = Notice.objects.get(kind="season")
    assert told.racer == admin and told.path == copy.get_absolute_url() and helper.notices.count() == 0
    assert told.params["season"] == "Season 2028" and "2028-01-01" in told.params["opens"]


def test_texts_stored_before_are_copied_without_their_invisible_characters():
    season = of_months(1)
    Season.objects.filter(pk=season.pk).update(name="Season\u202e 2027", prizes="A cup\u200b\nfor all")
    Round.objects.filter(season=season).update(name="January\u202e")
    Race.objects.filter(round__season=season).update(name="Night\u202e", description="One\u200b\ntwo")
    copy = copy_season(season=season, now=JANUARY).season
    round_ = copy.rounds.select_related("race").get()
    assert (copy.name, copy.prizes, round_.name) == ("Season 2028", "A cup\nfor all", "January")
    assert (round_.race.name, round_.race.description) == ("Night", "One\ntwo")


@pytest.mark.django_db(transaction=True)
def test_concurrent_clocks_draft_one_successor():
    season = of_months(1, 12)
    moment = datetime(2027, 12, 1, tzinfo=UTC)
    at_once([lambda: tick(now=moment)] * 4)
    assert Season.objects.count() == 2 and successor_of(season) is not None
    assert Event.objects.filter(kind="season.drafted").count() == 1
    assert Race.objects.count() == 4


def test_a_stopped_season_has_no_successor_until_it_continues_again():
    season = of_months(1, 12)
    edit_season(season=season, continues=False)
    moment = datetime(2027, 12, 1, tzinfo=UTC)
    tick(now=moment)
    assert Season.objects.count() == 1
    edit_season(season=season, continues=True)
    tick(now=moment)
    assert Season.objects.count() == 2


def test_a_season_that_an_admin_made_replaces_the_draft():
    of_months(1, 12)
    of_months(1, 2, year=2028, slug="hand-made")
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert Season.objects.count() == 2


def test_two_leagues_side_by_side_continue_both():
    of_months(1, 12, slug="2027-a")
    of_months(1, 12, slug="2027-b")
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert set(Season.objects.values_list("slug", flat=True)) == {"2027-a", "2027-b", "2028-a", "2028-b"}


def test_seasons_of_a_quarter_continue_a_year_later():
    first, second = of_months(1, 2, 3, slug="2027-q1"), of_months(4, 5, 6, slug="2027-q2")
    tick(now=datetime(2027, 12, 15, tzinfo=UTC))
    assert successor_of(first) is not None and successor_of(second) is None
    tick(now=datetime(2028, 3, 1, tzinfo=UTC))
    assert successor_of(second) is not None


def test_a_wholly_cancelled_season_is_not_continued(now):
    season = of_months(1, 12)
    for round_ in season.rounds.select_related("race"):
        cancel_race(race=round_.race, reason="Mistake", now=JANUARY - A_DAY)
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert Season.objects.count() == 1


def test_a_cancelled_race_is_in_the_next_season_again():
    season = of_months(1, 2, 12)
    cancel_race(race=season.rounds.get(number=2).race, reason="No track", now=JANUARY)
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert successor_of(season).rounds.count() == 3


def test_an_imported_season_is_not_continued():
    season = of_months(1, 12)
    Race.objects.update(imported_at=JANUARY)
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert successor_of(season) is None


def test_a_clock_that_stood_still_for_two_years_goes_on_in_the_running_month():
    season = of_months(*range(1, 13))
    moment = datetime(2030, 5, 10, tzinfo=UTC)
    tick(now=moment)
    copy = successor_of(season)
    assert copy.slug == "2030" and copy.rounds.count() == 8
    assert [race.opens_at.month for race in league_races(moment, Division.OPEN)] == [5]


def test_months_keep_their_bounds_over_leap_years_in_the_zone_of_the_season():
    seoul = ZoneInfo("Asia/Seoul")
    season = create_season(
        slug="2027", name="2027", starts_on=date(2027, 2, 1), ends_on=date(2027, 3, 31), zone="Asia/Seoul"
    )
    for number, month in ((1, 2), (2, 3)):
        times = {
            "opens_at": datetime(2027, month, 1, tzinfo=seoul),
            "closes_at": datetime(2027, month + 1, 1, tzinfo=seoul),
        }
        schedule_round(
            season=season, number=number, stage="open-qualifier", now=JANUARY, track=a_track(), name="A", **times
        )
    copy = copy_season(season=season, now=JANUARY).season
    first, second = (one.race for one in copy.rounds.select_related("race").order_by("number"))
    assert first.closes_at == second.opens_at == datetime(2028, 3, 1, tzinfo=seoul)
    assert copy.zone == "Asia/Seoul" and copy.ends_on == date(2028, 3, 31)


def test_a_race_of_a_leap_day_keeps_its_length():
    season = create_season(slug="2028", name="2028", starts_on=date(2028, 2, 28), ends_on=date(2028, 3, 1))
    times = {"opens_at": datetime(2028, 2, 28, tzinfo=UTC), "closes_at": datetime(2028, 2, 29, tzinfo=UTC)}
    now = datetime(2028, 1, 1, tzinfo=UTC)
    schedule_round(season=season, number=1, stage=Stage.SINGLE, now=now, track=a_track(), name="Leap", **times)
    (race,) = [one.race for one in copy_season(season=season, now=now).season.rounds.select_related("race")]
    assert (race.opens_at, race.closes_at) == (datetime(2029, 2, 28, tzinfo=UTC), datetime(2029, 3, 1, tzinfo=UTC))


def test_a_copy_has_settings_rules_and_prizes_and_a_draft_no_prizes():
    season = of_months(1, 12, promotion_percent=25, drop_worst=2, prizes="A cup")
    set_stage_rules(season=season, stage=Stage.OPEN, laps=7)
    copy = copy_season(season=season, now=JANUARY).season
    assert (copy.promotion_percent, copy.drop_worst, copy.prizes) == (25, 2, "A cup")
    assert copy.stage_rules.get(stage=Stage.OPEN).laps == 7
    copy.delete() if not copy.rounds.exists() else Round.objects.filter(season=copy).delete()
    Season.objects.filter(pk=copy.pk).delete()
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    assert successor_of(season).prizes == ""


def test_divisions_are_carried_over_and_follow_later_changes(now):
    season = a_season()
    round_, pro = a_round(season, 1, "open-qualifier"), a_round(season, 1, "pro-qualifier")
    put_in_division(season=season, racer=(early := a_racer()), division=Division.PRO, now=JANUARY)
    tick(now=datetime(2027, 12, 1, tzinfo=UTC))
    copy = successor_of(season)
    assert set(copy.memberships.values_list("racer", "division", "carried")) == {(early.pk, "pro", True)}
    board(round_.race, cast := racers(5))
    close_round(round=round_, now=after(round_))
    assert set(copy.memberships.values_list("racer", flat=True)) == {early.pk, cast[0].pk}
    put_in_division(season=season, racer=early, division=Division.OPEN, now=after(pro))
    give_fields(season, now=after(pro))
    assert list(copy.memberships.values_list("racer", flat=True)) == [cast[0].pk]
    put_in_division(season=copy, racer=cast[0], division=Division.OPEN, now=after(pro))
    give_fields(season, now=after(pro))
    assert Membership.objects.get(season=copy).division == Division.OPEN, "what an admin decided stays"


def test_a_copy_by_hand_needs_sensible_months_and_a_free_address():
    season = of_months(1, 12)
    with pytest.raises(UserFault) as refused:
        copy_season(season=season, now=JANUARY, months=0)
    assert refused.value.code == "season_copy_months"
    with pytest.raises(ValidationError):
        copy_season(season=season, now=JANUARY, slug="Now")
    assert copy_season(season=season, now=JANUARY, months=3, slug="spring", name="Spring").season.follows is None


@pytest.mark.parametrize(
    ("text", "later"),
    [
        ("Season 2026-27", "Season 2027-28"),
        ("2027", "2028"),
        ("2026-11-open", "2027-11-open"),
        ("Winter 1999–00", "Winter 1999–1"),
        ("Company cup", "Company cup 2"),
        ("Cup 3", "Cup 4"),
        ("2099-00", "2100-01"),
    ],
)
def test_names_move_on_by_a_year(text, later):
    assert later_text(text, 12) == later
