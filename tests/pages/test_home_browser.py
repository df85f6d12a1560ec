"""The lap that the first page plays, in a real browser: it moves, is small, takes no focus and opens the replay."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
MOST_BYTES = 200_000
PLACE = "document.querySelector('.replay-car')?.style.transform"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def run(browser, wakes):
    return a_driven_run(a_race(timezone.now(), name="Busy night"), a_racer("fast"), timezone.now(), lap_ms=20_000)


def test_the_leading_lap_plays_by_itself_and_opens_the_replay(browser, live_server, run) -> None:
    with visitor(browser, live_server.url) as context:
        page = context.new_page()
        sizes = []
        page.on("requestfinished", lambda request: sizes.append(request.sizes()["responseBodySize"]))
        page.goto("/")
        page.wait_for_selector(".replay-car")
        before = page.evaluate(PLACE)
        page.wait_for_function(f"(before) => {PLACE} !== before", arg=before)
        assert page.evaluate("document.activeElement.closest('#home-stage')") is None
        assert len(sizes) > 5 and sum(sizes) <= MOST_BYTES, f"{sum(sizes)} bytes until it is clicked"
        assert not page.locator("#home-stage [data-player]").is_visible()
        page.locator(".stage-link").click()
        page.wait_for_url(f"**/evaluations/{run.public_id}/replay/?lap=2")


def test_nothing_moves_for_readers_who_want_no_motion(browser, live_server, run) -> None:
    with visitor(browser, live_server.url, reduced_motion="reduce") as context:
        page = context.new_page()
        page.goto("/")
        page.wait_for_selector(".replay-car")
        before = page.evaluate(PLACE)
        page.wait_for_timeout(400)
        assert page.evaluate(PLACE) == before
