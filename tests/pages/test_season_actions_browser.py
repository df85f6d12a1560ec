"""An admin copies a season, stops it and deletes a race of it in a real browser, on a phone and on a wide screen."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from league.models import Season
from tests.factories import a_racer
from tests.league.seasons import a_round, a_season
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PASSWORD = "a long enough passphrase"
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture
def browser(monkeypatch: pytest.MonkeyPatch, wakes: list[dict]) -> Iterator[object]:
    monkeypatch.setattr("django.utils.timezone.now", lambda: datetime(2026, 11, 15, 12, tzinfo=UTC))
    with chromium() as opened:
        yield opened


@pytest.mark.parametrize("width", only([360], [360, 1280]))
def test_an_admin_copies_stops_and_trims_a_season(browser, live_server, width):
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    boss.set_password(PASSWORD)
    boss.save()
    season = a_season()
    for stage in ("open-qualifier", "pro-qualifier", "pro-finale"):
        a_round(season, 1, stage)
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(f"{live_server.url}/accounts/login/")
    page.fill("[name=login]", "boss")
    page.fill("[name=password]", PASSWORD)
    page.click("main form button")
    page.wait_for_url(lambda address: "/login/" not in address)
    page.goto(f"{live_server.url}/seasons/2027/")
    shot(page, f"season-{width}")
    page.click("#season-admin button")
    playwright.expect(page.locator("#season-admin")).to_contain_text("Ends without a successor")
    page.click("#season-admin button")
    playwright.expect(page.locator("#season-admin")).not_to_contain_text("Ends without a successor")
    page.click("#season-admin a:has-text('Copy this season')")
    shot(page, f"copy-{width}")
    page.click("main form button")
    page.wait_for_url("**/seasons/2028/")
    assert "2028" in page.locator("h1").inner_text()
    page.click("#season-admin a:has-text('Delete the season')")
    page.wait_for_url("**/delete/")
    shot(page, f"delete-{width}")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.click("button[aria-label*='finale']")
    playwright.expect(page.locator("button[aria-label*='finale']")).to_have_count(0)
    assert Season.objects.get(slug="2028").rounds.count() == 2
    page.click("button.danger:has-text('Delete the season')")
    page.wait_for_url("**/seasons/")
    assert not Season.objects.filter(slug="2028").exists()


def shot(page, name: str) -> None:
    """A picture for whoever wants to look at the pages."""
    if folder := os.environ.get("PADDOCK_SHOTS"):
        page.screenshot(path=f"{folder}/{name}.png", full_page=True)
