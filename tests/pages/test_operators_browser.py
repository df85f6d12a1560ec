"""Audit log, programs, status and needs in a real browser, narrow and wide, dark and light."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.utils import timezone

from core.audit.models import AuditEntry
from evaluation.models import WorkerNode
from races.models import ServiceDay
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PASSWORD = "a long enough passphrase"
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture
def browser(wakes: list[dict]) -> Iterator[object]:
    with chromium() as opened:
        yield opened


@pytest.mark.parametrize(("width", "scheme"), only([(360, "dark")], [(360, "dark"), (1280, "light")]))
def test_an_admin_makes_a_program_and_reads_the_log(browser, live_server, width, scheme):
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    boss.set_password(PASSWORD)
    boss.save()
    race = a_race(timezone.now(), organiser=boss, slug="the-race")
    WorkerNode.objects.create(name="celery@gone", seen_at=timezone.now() - timedelta(hours=1), queues=["celery"])
    today = timezone.now().date()
    for back in range(30):
        ServiceDay.objects.create(
            day=today - timedelta(days=back), runs=40, p50_ms=3_000 + 40 * back, p95_ms=7_000 + 900 * (back % 5)
        )
    problems: list[str] = []
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(f"{live_server.url}/status/")
    playwright.expect(page.get_by_role("img", name="Time from a submission to its result, by day")).to_be_visible()
    page.click("summary:has-text('By day')")
    playwright.expect(page.locator("#days tbody tr")).to_have_count(30)
    fits(page, f"status-{width}-{scheme}")
    page.goto(f"{live_server.url}/accounts/login/")
    page.fill("[name=login]", "boss")
    page.fill("[name=password]", PASSWORD)
    page.click("main form button")
    page.wait_for_url(lambda address: "/login/" not in address)
    page.goto(f"{live_server.url}/programs/")
    page.fill("[name=name]", "ci")
    page.fill("[name=purpose]", "Publishes results")
    page.click("text=Create the program")
    page.wait_for_url("**/programs/program-ci/")
    page.click("text=Create a token")
    page.fill("[name=password]", PASSWORD)
    page.click("main form button:has-text('Continue')")
    playwright.expect(page.locator("#new-token")).to_be_visible()
    fits(page, f"program-{width}-{scheme}")
    page.goto(f"{live_server.url}/programs/")
    fits(page, f"programs-{width}-{scheme}")
    page.goto(f"{live_server.url}/races/the-race/cancel/")
    page.fill("[name=reason]", "Rain")
    page.click("main form button")
    page.wait_for_url("**/races/the-race/")
    page.goto(f"{live_server.url}/audit/")
    playwright.expect(page.locator("#audit tbody tr")).to_have_count(3)
    fits(page, f"audit-{width}-{scheme}")
    page.select_option("[name=action]", "race.cancelled")
    page.click("main form button")
    playwright.expect(page.locator("#audit tbody tr")).to_have_count(1)
    playwright.expect(page.locator("#audit")).to_contain_text("Rain")
    page.goto(f"{live_server.url}/races/the-race/audit/")
    playwright.expect(page.locator("#audit tbody tr")).to_have_count(1)
    page.goto(f"{live_server.url}/needs/")
    playwright.expect(page.locator("#area-workers")).to_contain_text("celery@gone")
    fits(page, f"needs-{width}-{scheme}")
    assert AuditEntry.objects.filter(actor=boss, race=race.pk).count() == 1
    assert problems == []


def fits(page, name: str) -> None:
    """Nothing is wider than the screen. A picture is kept where ``SHOTS`` names a folder."""
    if folder := os.environ.get("SHOTS"):
        page.screenshot(path=f"{folder}/{name}.png", full_page=True)
    width = page.viewport_size["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width, name
