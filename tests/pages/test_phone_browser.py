"""Pages on a phone, 360 px wide, in a real browser: what comes first, what a row opens, nothing clipped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.utils import timezone

from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
PHONE = {"width": 360, "height": 740}
CLIPPED = """selector => [...document.querySelectorAll(selector)].filter((each) => each.offsetParent
    && each.getBoundingClientRect().right > innerWidth + 1).map((each) => each.textContent.trim())"""


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def world(browser, wakes):
    now = timezone.now()
    race, alice = a_race(now, name="Evening race"), a_racer("alice")
    drive(race, a_racer("a-racer-with-a-very-long-alias"), laps(11_000, 11_100, 11_200), now)
    mine = drive(race, alice, laps(12_000, 12_100, 12_200), now)
    a_model(alice, name="Lightning")
    return race, alice, mine


def test_the_board_comes_first_and_one_submit_stays_in_view(world, live_server, browser) -> None:
    race, alice, _ = world
    with visitor(browser, live_server.url, alice, viewport=PHONE) as context:
        page = context.new_page()
        page.goto(race.get_absolute_url())
        assert page.locator("#board").bounding_box()["y"] < 350
        submit = page.get_by_role("button", name="Submit", exact=True)
        assert submit.count() == 1 and not page.get_by_role("link", name="Submit a car").is_visible()
        for place in (0, 400, 800):
            page.evaluate("place => scrollTo(0, place)", place)
            box = submit.bounding_box()
            assert box["y"] > 0 and box["y"] + box["height"] <= PHONE["height"], place
        assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]


def test_a_row_opens_its_sectors_and_gap(world, live_server, browser) -> None:
    race, alice, _ = world
    with visitor(browser, live_server.url, alice, viewport=PHONE) as context:
        page = context.new_page()
        page.goto(race.get_absolute_url())
        row = page.locator("tr.me")
        gap, sectors, legend = row.locator(".c-gap"), row.locator(".c-sectors"), page.locator(".sector-legend")
        for each in (gap, sectors, legend):
            playwright.expect(each).to_be_hidden()
        row.locator(".time").click()
        playwright.expect(gap).to_have_text("+1.000")
        for each in (gap, sectors, legend, row.locator(".c-mid"), row.locator(".c-tries")):
            playwright.expect(each).to_be_visible()
        row.locator("summary").click()
        playwright.expect(gap).to_be_hidden()
        row.locator("summary").press("Enter")
        playwright.expect(gap).to_be_visible()


def test_the_navigation_and_the_laps_are_not_clipped(world, live_server, browser) -> None:
    _, alice, mine = world
    with visitor(browser, live_server.url, alice, viewport=PHONE) as context:
        page = context.new_page()
        page.goto(mine.evaluation.get_absolute_url())
        assert page.evaluate(CLIPPED, ".nav a, table.laps :is(td, th)") == []
        assert page.get_by_role("navigation", name="Site").get_by_role("link", name="Garage").is_visible()


def test_the_columns_stay_on_a_wide_screen(world, live_server, browser) -> None:
    race, alice, _ = world
    with visitor(browser, live_server.url, alice, viewport={"width": 1280, "height": 800}) as context:
        page = context.new_page()
        page.goto(race.get_absolute_url())
        assert page.locator("tr.me .c-gap").is_visible() and page.locator("tr.me .c-int").is_visible()
        detail = page.locator("tr.me + .row-detail")
        assert not detail.is_visible()
        page.locator("tr.me summary").click()
        playwright.expect(detail).to_be_visible()
        assert page.get_by_role("link", name="Submit a car").is_visible()
