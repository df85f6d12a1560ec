"""The guides in Korean in a real Chromium: axe finds nothing in them, and a search leads to its section."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.pages.test_every_page_browser import NARROW, WIDE, look_at

axe = pytest.importorskip("axe_playwright_python.base", reason="axe is not installed (make dev)")
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def test_a_korean_reader_finds_a_section_and_reads_it(browser, live_server):
    with browser.new_context(locale="ko-KR", bypass_csp=True, viewport=NARROW) as context:
        page = context.new_page()
        page.goto(f"{live_server.url}/guides/")
        page.get_by_label("안내서 검색").fill("심사위원용")
        page.get_by_label("안내서 검색").press("Enter")
        page.get_by_role("link", name="심사위원용", exact=True).click()
        page.wait_for_url("**/guides/organisers/#for-stewards")
        heading = page.get_by_role("heading", name="심사위원용", exact=True)
        assert heading.get_attribute("id") == "for-stewards"
        assert heading.evaluate("it => it.getBoundingClientRect().top") < NARROW["height"] / 2
        page.get_by_role("link", name="무엇을 언제까지 바꿀 수 있나", exact=True).first.click()
        page.wait_for_url("**/guides/organisers/#what-may-change-and-until-when")


@pytest.mark.parametrize("slug", ["reference", "racers"])
def test_axe_finds_nothing_in_a_korean_guide(slug, browser, live_server):
    with browser.new_context(locale="ko-KR", bypass_csp=True) as context:
        page = context.new_page()
        page.goto(f"{live_server.url}/guides/{slug}/")
        assert page.evaluate("document.documentElement.lang") == "ko"
        page.evaluate(axe.AXE_SCRIPT)
        assert look_at(page, NARROW, "dark", {}) == []
        assert look_at(page, WIDE, "light", {}) == []
