"""The audit of a reward function in a real browser: from the wizard and from the laboratory, on a phone as well."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.factories import a_racer, a_track
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
LATE_MS = 120_000
ASK = "Does it pay to drive fast?"
FAILS_LATE = (
    "def reward_function(params):\n    if params['progress'] > 50:\n        return 'far'\n    return params['speed']\n"
)
# text of the chart that its picture cuts off, and a page that is wider than its window
CUT_OFF = """[...document.querySelectorAll(".audit-chart text")].filter((text) => {
  const box = text.getBBox();
  return box.x < 0 || box.x + box.width > text.ownerSVGElement.viewBox.baseVal.width;
}).length"""
TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def ask(page, url: str) -> None:
    page.goto(url, wait_until="domcontentloaded")
    page.get_by_role("button", name=ASK).click()
    playwright.expect(page.locator(".audit-table tbody tr")).to_have_count(8, timeout=LATE_MS)


@pytest.mark.parametrize("url", ["/train/new/", "/learn/laboratory/"], ids=["wizard", "laboratory"])
def test_a_racer_sees_what_the_function_pays_for(browser, live_server, url) -> None:
    a_track()
    with visitor(browser, live_server.url, a_racer("asker")) as context:
        context.set_default_timeout(LATE_MS)
        page = context.new_page()
        ask(page, url)
        report = page.locator("[data-report]")
        playwright.expect(report.locator(".findings .bad").first).to_contain_text("driving slowly pays")
        playwright.expect(report.locator(".audit-drive")).to_have_count(8)
        # another function replaces the report; its mistake is marked in the line that made it
        page.locator("[data-reward-editor]").evaluate("(element, text) => element.editor.fill(text)", FAILS_LATE)
        page.get_by_role("button", name=ASK).click()
        playwright.expect(report.locator(".problems")).to_contain_text("first in “Fast lap”", timeout=LATE_MS)
        playwright.expect(page.locator(".cm-lintRange-error")).to_have_count(1)
        for width in (1280, 360):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate(CUT_OFF) == 0
            assert page.evaluate(TOO_WIDE) <= 0
        page.get_by_role("button", name="Validate").click()
        playwright.expect(page.locator(".audit-table")).to_have_count(0, timeout=LATE_MS)
