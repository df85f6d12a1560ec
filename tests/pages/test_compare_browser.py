"""Two runs beside each other, in a real browser: chosen by the keyboard or by a link, with and without scripts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from django.utils import timezone

from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
SHOTS = os.environ.get("PADDOCK_SHOTS")


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def pair(alice, wakes):
    now = timezone.now()
    race = a_race(now, slug="open", name="Open race")
    return a_driven_run(race, alice, now, lap_ms=9_000), a_driven_run(race, a_racer("bob"), now, lap_ms=8_000)


def transform(page, number: int) -> str:
    return page.locator(f'[data-car="{number}"]').get_attribute("transform") or ""


def test_a_ghost_drives_beside_the_car(browser, live_server, alice, pair):
    mine, _theirs = pair
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(mine.get_absolute_url())
        page.get_by_role("link", name="Compare with another run").click()
        row = page.get_by_role("row").filter(has_text="bob")
        playwright.expect(row).to_contain_text("leads")
        row.get_by_role("link").first.focus()
        page.keyboard.press("Enter")
        playwright.expect(page.get_by_role("heading", level=1)).to_contain_text("alice – bob")
        playwright.expect(page.get_by_text("bob is 1.000 s ahead at the line.")).to_be_visible()
        assert page.locator("svg.lap-chart").count() == 2
        seek = page.locator("[data-seek]")
        playwright.expect(seek).to_be_visible()
        seek.fill("0")
        begun = transform(page, 0), transform(page, 1)
        seek.fill("4000")  # the same clock: the faster one is farther along
        assert transform(page, 0) != begun[0] and transform(page, 1) != begun[1]
        assert transform(page, 0) != transform(page, 1)
        playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 2 · 0:04.000")
        page.get_by_label("alice").select_option("3")
        page.get_by_role("button", name="Compare").click()
        playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 3 ·")
        if SHOTS:
            shoot(page, "compared")
        assert not errors


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_car_has_the_colour_of_its_line(browser, live_server, alice, pair, scheme):
    mine, theirs = pair
    for run in pair:
        centre = [[*run.track.geometry.point_at(metres / 4)[:2], 1.5] for metres in range(40)]
        run.result.trajectory = [centre] * 3
        run.result.save()
    colour = "(each, name) => getComputedStyle(each)[name]"
    with visitor(browser, live_server.url, alice, color_scheme=scheme) as context:
        page = context.new_page()
        page.goto(f"{mine.get_absolute_url()}compare/{theirs.public_id}/")
        colours = []
        for number in (0, 1):
            body = page.locator(f'[data-car="{number}"] .above-body').evaluate(colour, "fill")
            assert page.locator(f".car-sample.line-car-{number} .shell-body").first.evaluate(colour, "fill") == body
            assert page.locator(f".track-line.lap-{number}").first.evaluate(colour, "stroke") == body
            colours.append(body)
        assert colours[0] != colours[1]


def test_a_phone_without_scripts_sees_charts_and_tables(browser, live_server, alice, pair):
    mine, theirs = pair
    options = {"java_script_enabled": False, "viewport": {"width": 360, "height": 740}}
    with visitor(browser, live_server.url, alice, **options) as context:
        page = context.new_page()
        page.goto(f"{mine.get_absolute_url()}compare/")
        page.get_by_label("Any other, by its link").fill(live_server.url + theirs.get_absolute_url())
        page.get_by_role("button", name="Compare").click()
        playwright.expect(page.get_by_role("img", name="bob is 1.000 s ahead at the line.")).to_be_visible()
        playwright.expect(page.get_by_role("region", name="Laps and sectors")).to_be_visible()
        playwright.expect(page.locator("[data-player]")).to_be_hidden()


def shoot(page, name: str) -> None:
    for width in (360, 1280):
        for theme in ("dark", "light"):
            page.set_viewport_size({"width": width, "height": 900})
            page.emulate_media(color_scheme=theme)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            page.screenshot(path=Path(SHOTS or ".") / f"{name}-{width}-{theme}.png", full_page=True)
