"""The scene of a replay in a real Chromium: cars where their traces have them, five cameras, a lost context."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import pytest

from paddock.rules.race import RaceRules
from paddock.simulator.car import Pose
from paddock.simulator.results import RaceResult
from paddock.simulator.solids import Solid, corner_inside
from paddock.simulator.trace import CRASHED
from tests.pages.browsing import IN_A_BROWSER, chromium
from tests.pages.viewer_documents import drive, open_scene, run_document, scene_document, track_of

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = IN_A_BROWSER

NEAR_M = 0.01
NOSE_M = 0.14
PARTS = 3  # looks within a step
TRACK = track_of("reinvent-2018")
# Where the noses of all cars are drawn: at each step of the first car and between two. The pictures themselves, which
# take seconds of a processor, are left out.
LOOK = """(parts) => {
  const { t } = replay.runs[0].columns, { renderer } = view, places = [];
  view.renderer = { ...renderer, render: () => {} };
  for (let i = 0; i < t.length; i += 1) {
    for (let k = 0; k < (i + 1 < t.length ? parts : 1); k += 1) {
      view.draw(replay, t[i] + (k / parts) * ((t[i + 1] ?? t[i]) - t[i]));
      const { x, y, yaw } = view.placeOf(0);
      places.push([x, y, yaw]);
    }
  }
  view.renderer = renderer;
  return places;
}"""
PICTURE = """(camera) => {
  if (camera) view.setCamera(camera);
  view.draw(replay, 4000);
  const gl = view.renderer.getContext(), pixels = new Uint8Array(64 * 36 * 4);
  gl.readPixels(0, 0, 64, 36, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return Array.from(pixels);
}"""


@cache
def boxed() -> RaceResult:
    """A lap among boxes, of which a car that looks for none hits the first ones."""
    rules = RaceRules(laps=1, direction="ccw", race_type="object_avoidance", random_boxes=4, max_resets=4)
    return drive(TRACK, rules, blind=True, speed=1.8)


@pytest.fixture
def page() -> Iterator[playwright.Page]:
    with chromium() as browser:
        opened = browser.new_page(viewport={"width": 400, "height": 300})
        wrong: list[str] = []
        opened.on("pageerror", lambda error: wrong.append(str(error)))
        opened.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
        yield opened
        opened.close()
    assert not wrong


def shown(page: playwright.Page, *results: RaceResult, direction: str = "ccw", **options: object) -> None:
    documents = [run_document(result, f"car {number}") for number, result in enumerate(results)]
    open_scene(page, scene_document(TRACK, direction), documents, **options)


def turn(before: float, after: float) -> float:
    return math.degrees(math.remainder(math.radians(after - before), 2 * math.pi))


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_car_is_within_a_centimetre_of_its_trace_at_each_step(page, direction):
    result = drive(TRACK, RaceRules(laps=1, direction=direction), speed=2.6, offset=0.1)
    shown(page, result, direction=direction)
    places = page.evaluate(LOOK, 1)
    trace = result.trace
    assert len(places) == len(trace) > 100
    for (x, y, yaw), *driven in zip(places, trace["X"], trace["Y"], trace["yaw"], strict=True):
        assert math.dist((x, y), driven[:2]) < NEAR_M
        assert abs(turn(yaw, driven[2])) < 0.1
    assert max(abs(b - a) for a, b in pairwise(trace["yaw"])) > 300  # a heading that jumps from 180 to -180


def test_a_car_turns_the_short_way_and_glides_over_no_reset(page):
    result = boxed()
    shown(page, result)
    places, trace = page.evaluate(LOOK, PARTS), result.trace
    jumps = 0
    for step in range(len(trace) - 1):
        here, there = ((trace["X"][at], trace["Y"][at], trace["yaw"][at]) for at in (step, step + 1))
        far = math.dist(here[:2], there[:2])
        jumps += far > 0.6
        for x, y, yaw in places[PARTS * step : PARTS * (step + 1)]:
            if far > 0.6:
                assert math.dist((x, y), here[:2]) < NEAR_M
                continue
            assert abs(turn(here[2], yaw)) <= abs(turn(here[2], there[2])) + 0.1
            assert math.dist((x, y), here[:2]) + math.dist((x, y), there[:2]) < far + NEAR_M
    assert jumps >= 2


def test_no_box_is_crossed_that_the_referee_did_not_report(page):
    result = boxed()
    shown(page, result)
    drawn = page.evaluate("view.cars.boxes.map(({root}) => [root.position.x, root.position.y, root.rotation.z])")
    boxes = [(x, y, yaw) for x, y, yaw in drawn]
    assert [[round(number, 2) for number in box] for box in boxes] == [
        [round(box[name], 2) for name in ("x", "y", "yaw")] for box in result.layout["boxes"]
    ]
    reported = {at for at, status in enumerate(result.trace["episode_status"]) if status == CRASHED}
    crossed = set()
    for number, (x, y, yaw) in enumerate(page.evaluate(LOOK, PARTS)):
        angle = math.radians(yaw)
        pose = Pose(x - NOSE_M * math.cos(angle), y - NOSE_M * math.sin(angle), angle)
        if any(_touches(pose, box) for box in boxes):
            crossed.add(number // PARTS)
    # a car that crashed stands in its box until it is put back
    paused = {at for at, status in enumerate(result.trace["episode_status"]) if status == "pause"}
    assert reported
    assert all(at in reported | paused or at + 1 in reported for at in crossed)


def _touches(pose: Pose, box: tuple[float, float, float]) -> bool:
    """Whether a corner of the car is inside a box as it is drawn."""
    car = Solid(*pose, 0.16176, 0.09805, 0.2, "car")
    return corner_inside(car.x, car.y, car.yaw, car.half_length, car.half_width, (*box, 0.15, 0.2))


def test_bots_drive_where_the_layout_has_them(page):
    result = drive(TRACK, RaceRules(laps=1, direction="ccw", race_type="head_to_head", bots=3), speed=1.2)
    shown(page, result)
    step = 40
    page.evaluate("(step) => view.draw(replay, replay.runs[0].columns.t[step])", step)
    drawn = page.evaluate("view.cars.bots.map(({root}) => [root.position.x, root.position.y])")
    places = [bot[step][:2] for bot in result.layout["bots"]]
    assert len(drawn) == len(places) == 3
    assert all(math.dist(one, other) < NEAR_M for one, other in zip(drawn, places, strict=True))


def test_each_camera_shows_another_picture(page):
    shown(page, boxed(), drive(TRACK, RaceRules(laps=1), speed=1.4))
    pictures = {name: page.evaluate(PICTURE, name) for name in ("chase", "onboard", "top", "trackside", "free")}
    assert all(
        len({tuple(pixels[at : at + 4]) for at in range(0, len(pixels), 4)}) > 40 for pixels in pictures.values()
    )
    pictures.pop("free")  # begins where the camera before it was
    assert len({tuple(pixels) for pixels in pictures.values()}) == len(pictures)
    before = page.evaluate(PICTURE, "free")
    page.locator("#scene").press("ArrowLeft")
    page.locator("#scene").press("+")
    assert page.evaluate(PICTURE, "") != before
    assert page.evaluate("view.renderer.info.render.calls") <= 24


def test_no_camera_moves_with_the_speed_where_motion_is_reduced(page):
    page.emulate_media(reduced_motion="reduce")
    shown(page, boxed())
    widths = page.evaluate("[0, 3000].map((ms) => { view.draw(replay, ms); return view.cameras.eye.fov; })")
    assert widths[0] == widths[1]
    page.emulate_media(reduced_motion="no-preference")
    shown(page, boxed())
    widths = page.evaluate("[0, 3000].map((ms) => { view.draw(replay, ms); return view.cameras.eye.fov; })")
    assert widths[0] != widths[1]


def test_a_lost_context_is_reported_and_drawn_again(page):
    shown(page, boxed())
    before = page.evaluate(PICTURE, "chase")
    page.evaluate("window.held = view.renderer.getContext().getExtension('WEBGL_lose_context'); held.loseContext()")
    page.wait_for_function("told.includes('lost')")
    page.evaluate("view.draw(replay, 1000)")
    page.evaluate("held.restoreContext()")
    page.wait_for_function("told.includes('restored')")
    assert page.evaluate(PICTURE, "chase") == before


def test_a_theme_changes_the_picture_and_disposing_frees_everything(page):
    shown(page, boxed(), drive(TRACK, RaceRules(laps=1), speed=1.4))
    light = page.evaluate(PICTURE, "chase")
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.wait_for_function("view.dark")
    assert sum(page.evaluate(PICTURE, "chase")) < 0.8 * sum(light)
    page.evaluate("view.clear()")
    assert page.evaluate("view.renderer.info.memory") == {"geometries": 0, "textures": 0}
    page.evaluate("view.dispose()")
    assert page.evaluate("view.renderer.getContext().isContextLost()")
