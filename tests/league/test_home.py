"""The first page: cards for races that the reader may enter, all others folded; divisions are explained."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from league.home.selectors import home_races
from league.models import Membership, Round
from league.seasons.services.seasons import create_season
from league.standings.rules import entry_rule
from races.entries.selectors.lists import racing_now
from races.models import Division
from tests.factories import a_race, a_racer, drive, laps
from tests.kept_parts import parts_are_kept
from tests.league.seasons import a_season

pytestmark = pytest.mark.django_db


@pytest.fixture
def now(wakes):
    return timezone.now()


@pytest.fixture
def season(now):
    """A season with an open and a pro race, a race of the community with somebody in it, and one without."""
    season = a_season(promotion_percent=20)
    for stage, division in (("open-qualifier", "open"), ("pro-qualifier", "pro")):
        race = a_race(now, slug=division, name=f"Month {division}", kind="league", division=division)
        Round.objects.create(season=season, number=1, stage=stage, race=race)
    drive(a_race(now, slug="busy", name="Busy night"), a_racer("bob"), laps(11_000, 11_000, 11_000), now)
    a_race(now, slug="quiet", name="Quiet night")
    past = {"opens_at": now - timedelta(days=9), "closes_at": now - timedelta(days=2)}
    a_race(now, slug="past", name="Past night", **past)
    return season


def page(racer=None, language="en") -> str:
    client = Client(headers={"accept-language": language})
    if racer is not None:
        client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client.get("/").content.decode()


def parts(html: str) -> tuple[str, str]:
    """The cards, and what is folded behind "All races"."""
    cards, _, folded = html.partition('id="all-races"')
    return cards.partition('id="home-races"')[2], folded.partition("</details>")[0]


def test_a_newcomer_sees_first_what_they_may_enter(season, now):
    for reader in (a_racer("newcomer"), None):
        cards, folded = parts(page(reader))
        assert "Month open" in cards and "Busy night" in cards
        for name in ("Month pro", "Quiet night"):
            assert name not in cards and name in folded
        assert "Past night" not in cards and "/races/?show=closed" in folded
        assert "This race is for the pro division." in folded


def test_a_pro_racer_sees_the_pro_race_and_why_the_open_one_is_closed_to_them(season, now):
    racer = a_racer("pro")
    Membership.objects.create(season=season, racer=racer, division=Division.PRO)
    cards, folded = parts(page(racer))
    assert "Month pro" in cards and "Month open" not in cards
    assert "You are in the pro division this season" in folded


def test_a_nearly_empty_site_shows_races_that_nobody_has_entered(now):
    a_race(now, slug="first", name="First night")
    assert "First night" in parts(page(a_racer("newcomer")))[0]


def test_more_league_races_cost_no_more_queries(season, now, django_assert_max_num_queries):
    """Once the rounds were read for an earlier reader."""
    racer = a_racer("newcomer")
    for number in range(2, 8):
        race = a_race(now, slug=f"pro-{number}", kind="league", division="pro")
        Round.objects.create(season=season, number=number, stage="pro-qualifier", race=race)
    with parts_are_kept():
        home_races(list(racing_now(now, racer)), a_racer("earlier"), now)
        with django_assert_max_num_queries(3):
            _, folded = home_races(list(racing_now(now, racer)), racer, now)
    assert len(folded) == 8


@pytest.mark.parametrize("slug", ["open", "pro"])
def test_the_page_of_a_league_race_says_what_it_takes(season, slug):
    html = Client().get(f"/races/{slug}/").content.decode()
    words = {
        "open": "Open division: everybody starts here. The best 20 % are promoted",
        "pro": "Pro division: finish in",
    }
    assert words[slug] in html and "/about/#divisions" in html
    for path in ("/", "/races/"):
        page = " ".join(Client().get(path).content.decode().split())
        assert 'class="pill division" href="/about/#divisions" title=' in page


@pytest.mark.parametrize("stage", ["open-qualifier", "pro-qualifier", "pro-finale", "championship", "single", None])
def test_every_stage_has_its_rule(season, stage):
    division = {"open-qualifier": "open", "single": "all"}.get(stage, "pro")
    for numbers in (season, None):
        assert entry_rule(division, stage, numbers).endswith(".")


@pytest.mark.parametrize("season_runs", [True, False])
def test_how_it_works_explains_the_league(now, season_runs):
    if season_runs:
        today = now.date()
        dates = {"starts_on": today, "ends_on": today + timedelta(days=300)}
        create_season(slug="this-year", name="This year", promotion_percent=20, points=[1], **dates)
    html = Client().get("/about/").content.decode()
    for anchor in ("divisions", "seasons", "promotion", "sensors"):
        assert f'id="{anchor}"' in html
    for words in ("Object avoidance", "Head-to-head", "Stereo cameras", "Lidar", "Open division", "Pro division"):
        assert words in html
    assert ("the best 20 %" in html) == season_runs
