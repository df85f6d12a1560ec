"""The part of the wizard for sweeps and the page of a sweep in a real browser; a trainer's end moves the page."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from django.utils import timezone

from tests.factories import a_racer, a_track
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.training.jobs import a_sweep_row
from training.models import Sweep
from training.sweeps.services import stop_sweep

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
pytest.importorskip("optuna", reason="training is not installed: make training")
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
# fields of ranges that reach over what follows them
WIDER_THAN_LABELS = """[...document.querySelectorAll(".sweep-range label")].filter((label) => {
  const field = label.querySelector("input");
  return field.getBoundingClientRect().right > label.getBoundingClientRect().right + 1;
}).length"""


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def test_a_racer_begins_and_stops_a_sweep(browser, live_server, wakes, trainings_taken_on, monkeypatch) -> None:
    monkeypatch.setattr("training.wizard.sweep.refusals", lambda *_: [])
    racer = a_racer("tuner")
    a_track()
    with visitor(browser, live_server.url, racer) as context:
        context.set_default_timeout(120_000)
        page = context.new_page()
        page.goto("/train/new/", wait_until="domcontentloaded")
        page.get_by_label("Name", exact=True).fill("Tuned")
        page.get_by_role("link", name="Try several settings").click()
        page.locator("#sweep summary").click()
        for width in (1280, 360):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate(WIDER_THAN_LABELS) == 0
        page.get_by_label("Settings to try").fill("2")
        page.get_by_label("Minutes for all together").fill("0.2")
        page.get_by_role("button", name="Try these settings").click()
        playwright.expect(page.locator("#sweep .errors")).to_contain_text("20 to 86400 seconds", timeout=120_000)
        page.get_by_label("Minutes for all together").fill("0.5")
        page.get_by_role("button", name="Try these settings").click()
        page.wait_for_url(re.compile(r"/train/sweeps/\w+/"), wait_until="domcontentloaded")
        sweep = Sweep.objects.get(owner=racer)
        assert (sweep.name, sweep.budget_s, sweep.settings_count) == ("Tuned", 30, 2)
        playwright.expect(page.locator("#trials tbody tr")).to_have_count(1)
        page.get_by_role("button", name="Stop the sweep").click()
        playwright.expect(page.locator("#sweep-state")).to_have_text("stopped", timeout=120_000)
        page.get_by_role("link", name="Delete this sweep").click()
        page.get_by_role("button", name="Delete").click()
        page.wait_for_url(re.compile(r"/train/$"), wait_until="domcontentloaded")
        assert not Sweep.objects.exists()


def test_an_open_page_of_a_sweep_shows_its_end(browser, live_server, wakes, trainings_taken_on) -> None:
    """Also cards that were not there when it was opened."""
    racer, now = a_racer("tuner"), timezone.now()
    sweep = a_sweep_row(racer, a_track(), now)
    with visitor(browser, live_server.url, racer) as context:
        page = context.new_page()
        page.goto(sweep.get_absolute_url())
        playwright.expect(page.get_by_role("button", name="Stop the sweep")).to_be_visible()
        stop_sweep(sweep=sweep, now=now, by=racer)
        playwright.expect(page.get_by_role("link", name="Delete this sweep")).to_be_visible(timeout=60_000)
        playwright.expect(page.get_by_role("button", name="Stop the sweep")).to_have_count(0)
        playwright.expect(page.locator("#sweep-state")).to_have_text("stopped")
