"""The reference lap in a real Chromium: its page plays it, a replay takes it as a ghost."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.reference_laps import a_reference

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture
def page(live_server, alice, wakes) -> Iterator[playwright.Page]:
    with chromium() as browser, visitor(browser, live_server.url, alice) as context:
        opened = context.new_page()
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        yield opened
    assert not errors


def test_the_page_of_a_reference_plays_its_best_lap(page: playwright.Page) -> None:
    now = timezone.now()
    track = a_race(now).track
    a_reference(track, 4_000, now)
    page.goto(track.get_absolute_url())
    page.get_by_role("link", name="Watch the reference lap").click()
    page.locator("[data-player]").wait_for()
    assert page.locator("[data-seek]").get_attribute("max") == "4000"
    page.locator("[data-seek]").fill("2000")
    assert page.locator('[data-car="0"]').count() == 1


def test_a_replay_shows_the_reference_as_a_ghost_with_its_name(page: playwright.Page, alice) -> None:
    now = timezone.now()
    race = a_race(now)
    run = a_driven_run(race, alice, now, lap_ms=5_000)
    a_reference(race.track, 4_000, now)
    page.goto(f"/evaluations/{run.public_id}/replay/?lap=2")
    page.get_by_role("link", name="Add the reference lap").click()
    page.locator("[data-tower]").get_by_text("Reference lap").wait_for()
    page.get_by_role("link", name="Remove the reference lap").click()
    page.get_by_role("link", name="Add the reference lap").wait_for()
    assert page.locator("[data-tower]").get_by_text("Reference lap").count() == 0
