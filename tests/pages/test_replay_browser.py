"""The flat map of a replay in a real Chromium, on columns made by hand: several cars, middles, the camera frame."""

from __future__ import annotations

import json
from collections.abc import Iterator
from time import monotonic

import pytest
from django.utils import timezone

from paddock.simulator.physics import PADDOCK_CAR
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.shared import CHECKOUT

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
PIXEL = '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'
NOSE_M = PADDOCK_CAR.nose_x
LOOK = {"shell": "kart", "colour": "#3b82f6", "above": '<g><path class="above-body" fill="#3b82f6" d="M0 0"/></g>'}


def car(number: int, *moments: int) -> dict[str, object]:
    """A car that drives to the right, half a metre in a second."""
    count = len(moments)
    columns = {
        **{"t": list(moments), "x": [moment / 2000 for moment in moments], "y": [1.0] * count, "yaw": [0.0] * count},
        **{"v": [1.0] * count, "steer": [0.0] * count, "lap": [1] * count, "status": ["in_progress"] * count},
        **{"progress": [moment / 1000 for moment in moments], "on_track": [True] * count},
    }
    lap = {"number": 1, "start_ms": 0, "time_ms": moments[-1], "complete": False, "sector_ms": []}
    return {"number": number, "name": f"car {number}", "look": LOOK, "laps": [lap], "columns": columns, "events": []}


@pytest.fixture
def page(live_server, alice, wakes) -> Iterator[playwright.Page]:
    """A duel whose first car is done after a second and whose other car drives on for another two."""
    shown = a_driven_run(a_race(timezone.now()), alice, timezone.now())
    bot = {"x": [4.0] * 3, "y": [2.0] * 3, "yaw": [90.0] * 3}
    run = car(0, 0, 500, 1000) | {"bots": [bot], "boxes": [], "rivals": [car(1, 0, 1000, 2000, 3000)]}
    with chromium() as browser, visitor(browser, live_server.url, alice) as context:
        opened = context.new_page()
        errors: list[str] = []
        opened.on("pageerror", lambda error: errors.append(str(error)))
        answer = {"body": json.dumps(run), "content_type": "application/json"}
        opened.route("**/replay.json", lambda route: route.fulfill(**answer))
        opened.goto(shown.get_absolute_url())
        opened.locator("[data-player]").wait_for()
        yield opened
    assert not errors


def middle_of(shape: playwright.Locator) -> list[float]:
    """Where a car or a bot is drawn, in metres of the track."""
    return shape.evaluate("""(shape) => {
      const { left, right, top, bottom } = shape.getBoundingClientRect();
      const world = shape.parentNode.querySelector("svg.overlay > g, svg.flat-map > g").getScreenCTM();
      const { x, y } = new DOMPoint((left + right) / 2, (top + bottom) / 2).matrixTransform(world.inverse());
      return [x, y];
    }""")


def test_a_duel_replay_runs_until_the_last_car_is_done(page: playwright.Page) -> None:
    assert page.locator("[data-seek]").get_attribute("max") == "3000"
    page.locator("[data-seek]").fill("2500")
    first, other = page.locator('[data-car="0"]'), page.locator('[data-car="1"]')
    assert middle_of(first) == pytest.approx((0.5 - NOSE_M, 1.0), abs=0.01)
    assert middle_of(other) == pytest.approx((1.25 - NOSE_M, 1.0), abs=0.01)
    assert "gone" in first.get_attribute("class") and "gone" not in other.get_attribute("class")
    assert "car 0 · Lap 1 · 0:01.000" in page.locator("[data-out]").text_content()
    page.locator("[data-toggle]").click()
    playwright.expect(page.locator("[data-seek]")).to_have_value("3000")
    playwright.expect(page.get_by_role("button", name="Play")).to_be_visible()


def test_a_car_is_drawn_around_its_middle_as_bots_are(page: playwright.Page) -> None:
    """A trace has the car's nose: drawn there, a car stood in the box or the bot that it had only touched."""
    page.locator("[data-seek]").fill("1000")
    for number in (0, 1):
        assert middle_of(page.locator(f'[data-car="{number}"]')) == pytest.approx((0.5 - NOSE_M, 1.0), abs=0.01)
    bot = page.locator(".replay-bot")
    assert middle_of(bot) == pytest.approx((4.0, 2.0), abs=0.01) and "rotate(-90" in bot.get_attribute("style")
    assert f"NOSE_M = {NOSE_M};" in (CHECKOUT / "static" / "viewer" / "store.js").read_text()


def test_the_camera_picture_waits_for_its_answer_before_the_next_request(page: playwright.Page) -> None:
    held: list[playwright.Route] = []
    aborted: list[str] = []
    page.locator("[data-seek]").fill("100")
    page.wait_for_timeout(1000)  # the first frame of the page has been asked for
    page.route("**/seen/*", lambda route: held.append(route))
    page.on("requestfailed", lambda request: aborted.append(request.url))

    def asked(count: int) -> bool:
        """Whether so many pictures have been asked for; waits for the last of them."""
        deadline = monotonic() + 30
        while len(held) < count and monotonic() < deadline:
            page.wait_for_timeout(20)
        return len(held) == count

    page.locator("[data-toggle]").click()
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
