"""A running training's page in a real Chromium: the newest evaluation drives in three dimensions, above its map."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import pytest
from django.utils import timezone

from tests.factories import a_racer, a_track
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.test_training import run
from tests.training.jobs import a_training
from training.models import TrainingJob

pytestmark = [
    *IN_A_BROWSER,
    pytest.mark.django_db(transaction=True),
    pytest.mark.usefixtures("trainings_taken_on"),
]
PLACE = """async () => {
  const { SceneView } = await import("/static/viewer/scene.js");
  return new Promise((done) => {
    const { draw } = SceneView.prototype;
    SceneView.prototype.draw = function (replay, ms) {
      draw.call(this, replay, ms);
      SceneView.prototype.draw = draw;
      const { x, y } = this.placeOf(0), { columns, look: { shell } } = replay.runs[0];
      const near = Math.min(...columns.x.map((at, i) => Math.hypot(at - x, columns.y[i] - y)));
      done({ near, first: [columns.x[0], columns.y[0]], shell });
    };
  });
}"""


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def a_driven_training() -> TrainingJob:
    alice, track = a_racer("alice"), a_track()
    job = run(a_training(alice, track, timezone.now(), name="Lightning"))
    geometry = track.geometry.in_direction(job.direction)
    places = [geometry.point_at(0.08 * step) for step in range(150)]
    job.driving = [[round(x, 3), round(y, 3), round(yaw, 3), 1.2] for x, y, yaw in places]
    job.save(update_fields=["driving"])
    return job


def test_the_newest_evaluation_drives_in_three_dimensions(browser, live_server):
    from playwright.sync_api import expect

    job = a_driven_training()
    wrong: list[str] = []
    page = visitor(browser, live_server.url, job.owner, viewport={"width": 360, "height": 800}).new_page()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(job.get_absolute_url())
    page.locator("#driving").scroll_into_view_if_needed()
    canvas = page.locator("[data-drive-scene]")
    expect(canvas).to_be_visible(timeout=60_000)
    canvas.scroll_into_view_if_needed()
    drawn = page.evaluate(PLACE)
    assert drawn["near"] < 0.09  # between two steps of 8 cm
    assert math.dist(drawn["first"], job.driving[0][:2]) < 0.01
    assert drawn["shell"] == job.shell
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(canvas).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    assert not wrong


def test_without_webgl_the_map_is_alone(browser, live_server):
    from playwright.sync_api import expect

    job = a_driven_training()
    page = visitor(browser, live_server.url, job.owner).new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(job.get_absolute_url())
    expect(page.locator("[data-drive-car]")).to_have_attribute("transform", re.compile("translate"))
    assert page.locator("[data-drive-scene]").is_hidden()
