"""The replay of a run in a real browser, on columns made by hand: no site is needed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from time import monotonic

import pytest

from paddock.simulator.physics import PADDOCK_CAR
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.shared import CHECKOUT

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = IN_A_BROWSER

PAGE = """<div data-replay="/run.json" data-play="Play" data-pause="Pause">
<svg viewBox="0 0 10 10" data-stage><polyline points="" data-tail/>
<defs><path d="M0 0" data-bot/></defs><g data-others></g>
<g data-car="0" hidden></g><g data-car="1" hidden></g></svg>
<div data-player hidden><button data-toggle>Play</button><input type="range" min="0" data-seek>
<select data-rate><option value="4">4</option></select><output data-out data-lap="Lap"></output></div>
<img data-seen="/seen.png" hidden><a href="/saw" data-saw>Camera view</a></div>"""

PIXEL = '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'


def columns(*moments: int) -> dict[str, list]:
    """A car that drives to the right, half a metre in a second."""
    count = len(moments)
    still = {"y": [1.0] * count, "yaw": [0.0] * count, "status": ["in_progress"] * count}
    return {"t": list(moments), "x": [moment / 2000 for moment in moments], **still}


@pytest.fixture
def page() -> Iterator[playwright.Page]:
    """A duel whose first car is done after a second and whose other car drives on for another two."""
    first = columns(0, 500, 1000) | {"v": [1.0] * 3, "steer": [0.0] * 3, "lap": [1] * 3}
    bot = {"x": [4.0] * 3, "y": [2.0] * 3, "yaw": [90.0] * 3}
    run = first | {"bots": [bot], "rivals": [columns(0, 1000, 2000, 3000) | {"number": 1}]}
    with chromium() as browser:
        opened = browser.new_page()
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.route("http://replay.test/", lambda route: route.fulfill(body=PAGE, content_type="text/html"))
        opened.route("**/run.json", lambda route: route.fulfill(body=json.dumps(run), content_type="application/json"))
        opened.goto("http://replay.test/")
        opened.add_script_tag(path=CHECKOUT / "static" / "runs" / "replay.js")
        opened.locator("[data-player]").wait_for()
        yield opened
    assert not errors


def test_a_duel_replay_runs_until_the_last_car_is_done(page: playwright.Page) -> None:
    assert page.locator("[data-seek]").get_attribute("max") == "3000"
    page.locator("[data-seek]").fill("2500")
    first, other = page.locator('[data-car="0"]'), page.locator('[data-car="1"]')
    assert "translate(0.5 1)" in first.get_attribute("transform") and "translate(1.25 1)" in other.get_attribute(
        "transform"
    )
    assert first.get_attribute("class") == "gone" and not other.get_attribute("class")
    assert "Lap 1 · 0:01.000" in page.locator("[data-out]").text_content()
    page.get_by_role("button").click()
    playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 1")
    playwright.expect(page.get_by_role("button", name="Play")).to_be_visible()
    assert page.locator("[data-seek]").input_value() == "3000"


def test_a_car_is_drawn_around_its_middle_as_bots_are(page: playwright.Page) -> None:
    """A trace has the car's nose: drawn there, a car stood in the box or the bot that it had only touched."""
    page.locator("[data-seek]").fill("1000")
    for number in (0, 1):
        shape = page.locator(f'[data-car="{number}"]')
        assert shape.get_attribute("transform").startswith("translate(0.5 1) rotate(0) translate(-0.14 0) scale")
    assert page.locator(".replay-bot").get_attribute("transform").startswith("translate(4 2) rotate(90) scale")
    for script in ("runs/replay.js", "live/show.js"):
        assert f"NOSE_M = {PADDOCK_CAR.nose_x};" in (CHECKOUT / "static" / script).read_text()


def test_the_camera_picture_waits_for_its_answer_before_the_next_request(page: playwright.Page) -> None:
    held: list[playwright.Route] = []
    aborted: list[str] = []
    page.route("**/seen.png*", lambda route: held.append(route))
    page.on("requestfailed", lambda request: aborted.append(request.url))

    def asked(count: int) -> bool:
        """Whether so many pictures have been asked for; waits for the last of them."""
        deadline = monotonic() + 30
        while len(held) < count and monotonic() < deadline:
            page.wait_for_timeout(20)
        return len(held) == count

    page.get_by_role("button").click()
    assert asked(1)
    page.wait_for_timeout(1500)
    assert asked(1), "the first picture has not arrived yet"
    held[0].fulfill(body=PIXEL, content_type="image/svg+xml")
    assert asked(2), "the next picture follows the first"
    held[1].abort()
    page.locator("[data-seek]").fill("1000")
    assert asked(3), "a picture that failed does not stop the following ones"
    held[2].fulfill(body=PIXEL, content_type="image/svg+xml")
    assert [url for url in aborted if url != held[1].request.url] == []
