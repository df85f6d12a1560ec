"""A whole season in a real browser: time is moved from one moment to the next, the pages do the rest."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import pytest

from evaluation.running.queue.worker import run_next_evaluation
from league.house_cars.services import HOUSE_CARS_DIR
from league.models import Membership, Season, Stage
from league.stewarding.official_results import close_due_rounds
from races.models import Entry, Race
from tests.factories import a_racer, a_track
from tests.happened import tell_what_happened
from tests.league.seasons import HOUR, racers, stand
from tests.pages.browsing import IN_A_BROWSER, chromium

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PASSWORD = "a long enough passphrase"
CAR = HOUSE_CARS_DIR / "flyer.onnx"

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


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
def clock(monkeypatch: pytest.MonkeyPatch, settings, wakes: list[dict]) -> Clock:
    clock = Clock()
    monkeypatch.setattr("django.utils.timezone.now", lambda: clock.now)
    settings.SESSION_COOKIE_AGE = 10 * 365 * 24 * 3600
    return clock


@pytest.fixture
def browser() -> Iterator[object]:
    with chromium() as opened:
        yield opened


def test_a_racer_rises_from_promotion_to_the_hall_of_fame(clock, browser, live_server):
    """The racer does everything on pages with a real car, which a worker really drives; so do admins. Rivals' times
    are written to be slower or faster than the car's own."""
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
    office.get_by_label("Championship places per finale").fill("2")
    for stage, first in (("pro", "time_trial"), ("championship", "time_trial")):  # the car sees no boxes
        office.locator(f"[name={stage}_turn_1]").select_option(first)
    office.locator("[name=pro_turn_2]").select_option("")
    office.get_by_role("button", name="Preview the season").click()
    playwright.expect(office.get_by_role("heading", name="Preview: 37 races")).to_be_visible()
    office.locator("[data-round='2-open']").get_by_role("button", name="Change").click()
    office.get_by_label("Submissions per racer").fill("20")
    office.get_by_role("button", name="Change this race").click()
    playwright.expect(office.locator("[data-round='2-open'] .tag")).to_have_text("changed")
    assert not Season.objects.exists(), "nothing is made before it was looked at"
    office.get_by_role("button", name="Create the season").click()
    playwright.expect(office.get_by_text("Season created: 37 races.")).to_be_visible()
    season = Season.objects.get()
    assert season.rounds.get(number=2, stage=Stage.OPEN).race.max_submissions == 20
    race = {
        stage: season.rounds.get(number=number, stage=stage).race
        for number, stage in ((1, Stage.OPEN), (2, Stage.PRO), (2, Stage.FINALE), (12, Stage.CHAMPIONSHIP))
    }

    # January: a newcomer signs up, uploads a car and sends it to the race of the month
    clock.move_to(race[Stage.OPEN].opens_at + timedelta(days=4))
    page = browser.new_context().new_page()
    page.goto(f"{live_server.url}/accounts/signup/")
    page.get_by_label("Alias").fill("hero")
    page.get_by_label("Email").fill("hero@example.org")
    page.get_by_label("Password", exact=True).fill(PASSWORD)
    page.get_by_label("Password (again)").fill(PASSWORD)
    page.get_by_role("main").get_by_role("button", name="Sign up").click()
    page.get_by_role("navigation", name="Site").get_by_role("link", name="Garage").click()
    upload(page, live_server.url)
    page.get_by_role("navigation", name="Site").get_by_role("link", name="League").click()
    page.get_by_role("link", name=race[Stage.OPEN].name).first.click()
    score = send_and_drive(page, race[Stage.OPEN])
    rivals = racers(19)
    stand(race[Stage.OPEN], rivals[0], score - 1000)
    for place, rival in enumerate(rivals[1:], start=1):
        stand(race[Stage.OPEN], rival, score + 1000 * place)
    page.reload()
    playwright.expect(page.get_by_text("↑ would be promoted to the pro division")).to_be_visible()
    mine = page.locator("#board tr.me")
    playwright.expect(mine).to_contain_text(f"{score // 60_000}:{score // 1000 % 60:02}.{score % 1000:03}")
    playwright.expect(mine.locator("td.place")).to_have_text("2")
    playwright.expect(page.locator("#race-facts")).to_contain_text("in the zone")

    # February: promoted, told so; the winner is found out, which the admin is shown the consequences of first
    clock.move_to(race[Stage.PRO].opens_at + timedelta(hours=4))
    page.reload()
    playwright.expect(page.get_by_text("↑ promoted to the pro division")).to_be_visible()
    page.get_by_role("link", name="Notices").click()
    playwright.expect(page.get_by_text("You are promoted")).to_be_visible()
    office.goto(live_server.url + race[Stage.OPEN].get_absolute_url())
    office.locator("#steward-actions").get_by_role("button", name="Disqualify").click()
    office.locator(f"input[name=racer][value={rivals[0].alias}]").check()
    office.get_by_label("Reason").fill("Two accounts")
    office.get_by_role("button", name="Preview").click()
    playwright.expect(office.get_by_text(f"{rivals[0].alias} is no longer promoted")).to_be_visible()
    playwright.expect(office.get_by_text(f"{rivals[1].alias} is now promoted")).to_be_visible()
    assert Membership.objects.filter(racer=rivals[0]).exists(), "nothing is done before it is said"
    office.get_by_role("button", name="Disqualify").click()
    playwright.expect(office.locator("#stewards")).to_contain_text("Two accounts")
    assert set(Membership.objects.values_list("racer__alias", flat=True)) == {"hero", rivals[1].alias}

    # a pro looks at the open race and drives the pro one
    page.goto(f"{live_server.url}/seasons/{season.slug}/")
    page.get_by_role("link", name=season.rounds.get(number=2, stage=Stage.OPEN).race.name).first.click()
    playwright.expect(page.get_by_text("You are in the pro division this season")).to_be_visible()
    playwright.expect(page.locator("#send")).to_have_count(0)
    page.goto(f"{live_server.url}/seasons/{season.slug}/")
    page.get_by_role("link", name=race[Stage.PRO].name).first.click()
    score = send_and_drive(page, race[Stage.PRO])
    stand(race[Stage.PRO], rivals[1], score + 500)
    page.reload()
    playwright.expect(page.get_by_text("↑ would be in the finale")).to_be_visible()

    # March: in the finale, and first over the line
    clock.move_to(race[Stage.FINALE].opens_at + HOUR)
    page.goto(f"{live_server.url}/seasons/{season.slug}/finales/")
    playwright.expect(page.get_by_role("listitem").filter(has_text="hero").first).to_be_visible()
    page.get_by_role("link", name=race[Stage.FINALE].name).first.click()
    score = send_and_drive(page, race[Stage.FINALE])
    stand(race[Stage.FINALE], rivals[1], score + 2_000)
    clock.move_to(race[Stage.FINALE].closes_at + HOUR)
    page.get_by_role("link", name="Notices").click()
    playwright.expect(page.get_by_text("You have qualified for the championship")).to_be_visible()
    page.goto(f"{live_server.url}/hall-of-fame/")
    playwright.expect(page.get_by_role("listitem").filter(has_text="hero")).to_contain_text("February")

    # January again: the championship closes the season
    clock.move_to(race[Stage.CHAMPIONSHIP].opens_at + HOUR)
    page.goto(live_server.url + race[Stage.CHAMPIONSHIP].get_absolute_url())
    score = send_and_drive(page, race[Stage.CHAMPIONSHIP])
    stand(race[Stage.CHAMPIONSHIP], rivals[1], score + 3_000)
    clock.move_to(race[Stage.CHAMPIONSHIP].closes_at + HOUR)
    page.goto(f"{live_server.url}/hall-of-fame/")
    playwright.expect(page.locator(".hall-champion")).to_contain_text("hero")
    page.get_by_role("link", name="hero").first.click()
    playwright.expect(page.locator("svg.progress-chart")).to_be_visible()
    for word in ("promoted", "in the finale", "qualified"):
        playwright.expect(page.get_by_role("table").get_by_text(word, exact=True)).to_be_visible()
    assert season.rounds.filter(closed_at=None).count() == 0


def upload(page, address: str) -> None:
    """Put the fastest car that comes with the project into the garage, as a racer does."""
    page.goto(f"{address}/models/upload/")
    page.locator("input[type=file]").set_input_files(
        [
            {"name": "hero.onnx", "mimeType": "application/octet-stream", "buffer": CAR.read_bytes()},
            {
                "name": "model_metadata.json",
                "mimeType": "application/json",
                "buffer": CAR.with_suffix(".json").read_bytes(),
            },
        ]
    )
    page.get_by_role("main").get_by_role("button", name="Upload").click()
    playwright.expect(page.get_by_role("heading", name="hero", exact=True)).to_be_visible(timeout=60_000)


def send_and_drive(page, race: Race) -> int:
    """Send the car in the garage to the race whose page is open, and let a worker drive it: its score in ms."""
    playwright.expect(page).to_have_url(re.compile(f"{race.get_absolute_url()}$"))
    page.locator("#send").get_by_role("button", name="Submit").click()
    playwright.expect(page.locator("#live-card")).to_contain_text("hero")
    while run_next_evaluation(worker="test"):
        pass
    entry = Entry.objects.get(race=race, racer__alias="hero")
    assert entry.classified, entry.best and entry.best.evaluation.failure_code
    page.goto(page.url.split("#")[0])
    return entry.score_ms


def log_in(page, address: str, alias: str) -> None:
    page.goto(f"{address}/accounts/login/")
    page.get_by_label("Alias or e-mail address").fill(alias)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("main").get_by_role("button", name="Log in").click()
    page.wait_for_url(f"{address}/")
