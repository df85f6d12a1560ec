"""A whole season in a real browser: time is moved from one moment to the next, the pages do the rest."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from league.models import Racer, Season, Stage
from league.services import close_due_rounds
from league.services.notices import tell_what_happened
from tests.factories import a_racer, a_track, drive, laps
from tests.league.seasons import HOUR, racers, stand

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update"]
PASSWORD = "a long enough passphrase"

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.xdist_group("browser"),
    pytest.mark.skipif(not CHROMIUM.exists(), reason="Chromium is not installed (apt-get install chromium)"),
    pytest.mark.django_db(transaction=True),
]


class Clock:
    """The moment that every view of the site lives in."""

    now = datetime(2026, 11, 15, 12, tzinfo=UTC)

    def move_to(self, moment: datetime) -> datetime:
        """Go there; what the periodic task does is done there too."""
        self.now = moment
        close_due_rounds(now=moment)
        tell_what_happened(now=moment)
        return moment


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, settings, bell: list[dict]) -> Clock:
    clock = Clock()
    monkeypatch.setattr("django.utils.timezone.now", lambda: clock.now)
    # Playwright's loop runs in this thread, and the tests read the database beside it
    monkeypatch.setitem(os.environ, "DJANGO_ALLOW_ASYNC_UNSAFE", "true")
    settings.SESSION_COOKIE_AGE = 10 * 365 * 24 * 3600
    return clock


@pytest.fixture
def browser() -> Iterator[object]:
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield opened
        opened.close()


def test_a_racer_is_promoted_qualifies_wins_a_finale_and_stands_in_the_hall_of_fame(clock, browser, live_server):
    a_track()
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    boss.set_password(PASSWORD)
    boss.save()

    # an admin makes the season with one form
    office = browser.new_context().new_page()
    log_in(office, live_server.url, "boss")
    office.goto(f"{live_server.url}/seasons/")
    office.get_by_role("link", name="New season").click()
    office.get_by_label("Cars in a finale").fill("3")
    office.get_by_label("Places in the championship from each finale").fill("2")
    office.get_by_role("button", name="Make the season").click()
    playwright.expect(office.get_by_text("The season is made: 37 races.")).to_be_visible()
    season = Season.objects.get()
    race = {
        stage: season.rounds.get(number=number, stage=stage).race
        for number, stage in ((1, Stage.OPEN), (2, Stage.PRO), (2, Stage.FINALE), (12, Stage.CHAMPIONSHIP))
    }

    # January: a newcomer signs up and finds the race of the month
    now = clock.move_to(race[Stage.OPEN].opens_at + timedelta(days=4))
    page = browser.new_context().new_page()
    page.goto(f"{live_server.url}/accounts/signup/")
    page.get_by_label("Alias").fill("hero")
    page.get_by_label("Email").fill("hero@example.org")
    page.get_by_label("Password", exact=True).fill(PASSWORD)
    page.get_by_label("Password (again)").fill(PASSWORD)
    page.get_by_role("main").get_by_role("button", name="Sign up").click()
    page.get_by_role("navigation", name="Site").get_by_role("link", name="League").click()
    page.get_by_role("link", name=race[Stage.OPEN].name).first.click()
    hero = Racer.objects.get(alias="hero")
    rivals = racers(19)
    for place, rival in enumerate(rivals):
        stand(race[Stage.OPEN], rival, 31_000 + 1000 * place)
    drive(race[Stage.OPEN], hero, laps(30_000, 30_000, 30_000), now)
    page.reload()
    playwright.expect(page.get_by_text("↑ would be promoted to the pro division")).to_be_visible()
    playwright.expect(page.locator("#board tr.me")).to_contain_text("0:30.000")

    # February: promoted, told so, and on the pro board
    now = clock.move_to(race[Stage.PRO].opens_at + timedelta(days=4))
    page.reload()
    playwright.expect(page.get_by_text("↑ promoted to the pro division")).to_be_visible()
    page.get_by_role("link", name="Notices").click()
    playwright.expect(page.get_by_text("You are promoted")).to_be_visible()
    drive(race[Stage.PRO], hero, laps(*[29_000] * 5), now)
    stand(race[Stage.PRO], rivals[0], 29_500)
    page.goto(live_server.url + race[Stage.PRO].get_absolute_url())
    playwright.expect(page.get_by_text("↑ would be in the finale")).to_be_visible()

    # March: in the finale, and first over the line
    now = clock.move_to(race[Stage.FINALE].opens_at + HOUR)
    page.goto(f"{live_server.url}/seasons/{season.slug}/finales/")
    playwright.expect(page.get_by_role("listitem").filter(has_text="hero").first).to_be_visible()
    drive(race[Stage.FINALE], hero, laps(28_000, 28_000, 28_000), now)
    stand(race[Stage.FINALE], rivals[0], 90_000)
    now = clock.move_to(race[Stage.FINALE].closes_at + HOUR)
    page.goto(f"{live_server.url}/notices/")
    playwright.expect(page.get_by_text("You have qualified for the championship")).to_be_visible()
    page.goto(f"{live_server.url}/hall-of-fame/")
    playwright.expect(page.get_by_role("listitem").filter(has_text="hero")).to_contain_text("February")

    # January again: the championship closes the season
    now = clock.move_to(race[Stage.CHAMPIONSHIP].opens_at + HOUR)
    drive(race[Stage.CHAMPIONSHIP], hero, laps(*[27_000] * 5), now)
    clock.move_to(race[Stage.CHAMPIONSHIP].closes_at + HOUR)
    page.reload()
    playwright.expect(page.locator(".hall-champion")).to_contain_text("hero")
    page.goto(f"{live_server.url}/seasons/{season.slug}/racers/hero/")
    playwright.expect(page.locator("svg.progress-chart")).to_be_visible()
    for word in ("promoted", "in the finale", "qualified"):
        playwright.expect(page.get_by_role("table").get_by_text(word, exact=True)).to_be_visible()
    assert season.rounds.filter(closed_at=None).count() == 0


def log_in(page, address: str, alias: str) -> None:
    page.goto(f"{address}/accounts/login/")
    page.get_by_label("Alias or e-mail address").fill(alias)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("main").get_by_role("button", name="Log in").click()
    page.wait_for_url(f"{address}/")
