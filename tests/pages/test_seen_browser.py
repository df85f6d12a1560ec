"""Camera view, in a real browser: beside the replay at each moment, and step by step without scripts."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.evaluation.test_seeing import run  # noqa: F401
from tests.pages.browsing import IN_A_BROWSER, SHOTS, chromium, shoot, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def test_the_frame_follows_the_replay(browser, live_server, transactional_db, run):  # noqa: F811
    evaluation, _ = run
    with visitor(browser, live_server.url, evaluation.owner) as context:
        page = context.new_page()
        page.goto(evaluation.get_absolute_url())
        frame = page.locator("[data-seen]")
        seek = page.locator("[data-seek]")
        playwright.expect(seek).to_be_visible()
        seek.fill("2000")
        seek.scroll_into_view_if_needed()
        playwright.expect(frame).to_have_attribute("src", f"/evaluations/{evaluation.public_id}/seen/?ms=2000")
        playwright.expect(frame).to_be_visible()
        playwright.expect(frame).to_have_js_property("naturalWidth", 320)
        if SHOTS:
            shoot(page, "run")
        page.get_by_role("link", name="Camera view").click()
        playwright.expect(page.get_by_role("heading", name="Lap 1 · 0:02.000")).to_be_visible()
        assert page.locator(".answer-bars li").count() == len(evaluation.spec["metadata"]["action_space"])
        if SHOTS:
            shoot(page, "saw")


def test_the_steps_are_links(browser, live_server, transactional_db, run):  # noqa: F811
    evaluation, _ = run
    with visitor(browser, live_server.url, None, java_script_enabled=False) as context:
        page = context.new_page()
        page.goto(f"{evaluation.get_absolute_url()}saw/?lap=1&ms=1000")
        before = page.locator(".seen-frame").get_attribute("src")
        page.get_by_role("link", name="A second after").focus()
        page.keyboard.press("Enter")
        playwright.expect(page.get_by_role("heading", name="Lap 1 · 0:02.000")).to_be_visible()
        assert page.locator(".seen-frame").get_attribute("src") != before
        assert page.locator(".answer-bars").count() == 0
