"""A live event in the viewer, in a real Chromium: cars where the poses that were sent have them, in three
dimensions and on the map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.utils import timezone

from paddock.rules.race import MAX_CARS, RaceRules
from races.live.services import tick_live
from races.live.streaming.pose_chunks import CHUNK_MS, cut
from races.replays.document import trace_columns
from tests.heats import a_heat_on_track
from tests.live_shows import slots
from tests.pages.browsing import IN_A_BROWSER, SHOTS, chromium, shoot, visitor
from tests.pages.viewer_documents import drive, open_scripts, scene_document, track_of

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
NEAR_M = 0.01
PIXEL_M = 0.05  # about two pixels of the map
NOSE_M = 0.14
SINCE_S = 4
# Where each car is drawn when a step of its poses was sent: [car, t, x and y of the nose in the scene, of the middle on
# the map]. The show stands meanwhile, and no picture is made.
DRAWN = """() => {
  const { show } = document.querySelector("[data-show]"), { stage, replay } = show, places = [];
  show.draw = () => {};
  stage.scene.renderer = { ...stage.scene.renderer, render: () => {} };
  const world = stage.root.querySelector("svg.overlay > g").getScreenCTM().inverse();
  replay.cars.forEach((run, car) => run.columns.t.forEach((t) => {
    stage.draw(t);
    const { x, y } = stage.scene.placeOf(car);
    const box = stage.root.querySelector(`[data-car="${car}"]`).getBoundingClientRect();
    const middle = new DOMPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2).matrixTransform(world);
    places.push([car, t, x, y, middle.x, middle.y]);
  }));
  return places;
}"""
IN_3D = "() => Boolean(document.querySelector('[data-show]').show.stage?.scene)"
ALL_STOPPED = """() => {
  const { cars } = document.querySelector("[data-show]").show.replay;
  return cars.length > 0 && cars.every(({ grows }) => !grows);
}"""
# Eight cars, chunk by chunk as pages get them, drawn at each step, without a picture: [car, t, x, y].
EIGHT = """async ({ scene, chunks, names, long }) => {
  const { LiveReplay } = await import("/static/viewer/live-replay.js");
  const { createScene } = await import("/static/viewer/scene.js");
  const look = { shell: "wedge", colour: "#ef4444", above: "" };
  const replay = new LiveReplay(scene, names.map((name, number) => ({ number, name, look })));
  const view = createScene(document.getElementById("scene"), replay), places = [], leaders = [];
  view.draw(replay, 0);
  view.renderer = { ...view.renderer, render: () => {} };
  for (const chunk of chunks) {
    replay.add(chunk, (chunk.n + 1) * long);
    for (const { t } of chunk.cars) for (const ms of t) {
      view.draw(replay, ms);
      chunk.cars.forEach(({ t: own }, car) => {
        if (!own.includes(ms)) return;
        const { x, y } = view.placeOf(car);
        places.push([car, ms, x, y]);
      });
    }
    leaders.push(replay.order((chunk.n + 1) * long - 1)[0].run.name);
  }
  replay.finish();
  return { places, leaders, order: replay.order(replay.duration).map(({ run, gap }) => [run.name, run.complete, gap]) };
}"""


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def opened(browser, live_server, wakes):
    """Opens the pages of a heat of the most cars that a run has, which is on track; with what was sent to them."""
    event, result = a_heat_on_track(timezone.now(), SINCE_S)
    wrong: list[str] = []

    def goto(path: str = "event/", camera: str = "chase", **options):
        page = visitor(browser, live_server.url, **options).new_page()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.sent = []
        page.on("response", lambda said: page.sent.append(said) if "poses.json" in said.url and said.ok else None)
        page.add_init_script(f"localStorage.setItem('viewer-camera', '{camera}')")
        page.goto(f"/races/duel-night/{path}")
        return page

    goto.event, goto.result = event, result
    yield goto
    assert not wrong


def sent_to(page) -> dict[tuple[int, int], tuple[float, float, float]]:
    """x, y and yaw by car and time, of all poses that a page has got."""
    chunks = [chunk for said in page.sent for chunk in said.json()["chunks"]]
    return {
        (car["number"], t): pose
        for chunk in chunks
        for car in chunk["cars"]
        for t, *pose in zip(car["t"], car["x"], car["y"], car["yaw"], strict=True)
    }


def test_a_heat_of_the_most_cars_is_drawn_where_its_poses_were_sent(opened):
    page = opened(viewport={"width": 1280, "height": 900})
    page.wait_for_function(IN_3D)
    page.wait_for_function("() => document.querySelector('[data-show]').show.replay.runs.length > 1")
    played = (timezone.now() - slots(opened.event)[0].starts_at) / timedelta(milliseconds=1)
    places = page.evaluate(DRAWN)
    poses = sent_to(page)
    assert {car for car, *_ in places} == set(range(MAX_CARS)) and len(places) > 100
    for car, t, x, y, map_x, map_y in places:
        sent_x, sent_y, yaw = poses[car, t]
        assert math.dist((x, y), (sent_x, sent_y)) < NEAR_M, (car, t)
        angle = math.radians(yaw)
        middle = sent_x - NOSE_M * math.cos(angle), sent_y - NOSE_M * math.sin(angle)
        assert math.dist((map_x, map_y), middle) < PIXEL_M, (car, t)
    assert max(t for _car, t, *_ in places) <= played + 5_000, "nothing of the future"
    driven = [opened.result.trace, *(rival.trace for rival in opened.result.rivals)]
    for (car, _t), (x, y, _yaw) in poses.items():
        assert min(math.dist((x, y), place) for place in zip(driven[car]["X"], driven[car]["Y"], strict=True)) < NEAR_M


def test_the_tower_of_a_heat_has_its_order_and_follows_who_is_chosen(opened):
    page = opened(viewport={"width": 1280, "height": 900})
    page.wait_for_function(IN_3D)
    rows = page.locator("[data-viewer] tbody tr")
    playwright.expect(rows).to_have_count(MAX_CARS)
    playwright.expect(rows.nth(0)).to_contain_text("leads")
    if SHOTS:
        shoot(page, "heat")
    page.get_by_role("button", name="Dora").click()
    playwright.expect(page.locator("[data-viewer] tr.focus")).to_contain_text("Dora")
    page.wait_for_function("() => document.querySelector('[data-show]').show.stage.scene.follow === 3")
    big = opened("live/screen/", viewport={"width": 1920, "height": 1080})
    big.wait_for_function(IN_3D)
    playwright.expect(big.locator("[data-viewer] tbody tr")).to_have_count(MAX_CARS)
    assert big.locator("a, button, input, select").count() == 0, "a screen has no controls"
    # to the end: the order is the referee's
    slot = slots(opened.event)[0]
    type(slot).objects.filter(pk=slot.pk).update(starts_at=slot.starts_at - timedelta(minutes=1))
    type(slot).objects.filter(pk=slot.pk).update(ends_at=slot.ends_at - timedelta(minutes=1))
    page.reload()
    page.wait_for_function(ALL_STOPPED)
    names = ["Ada", "Bob", "Carl", "Dora"]
    order = page.evaluate(
        """() => {
          const { replay } = document.querySelector("[data-show]").show;
          return replay.order(replay.duration).map(({ run, gap }) => [run.name, gap]);
        }"""
    )
    entries = [entry.racer.alias for entry in slot.starting]
    assert sorted(entries) == names
    assert [name for name, _gap in order] == [entries[car] for car in opened.result.order]
    assert [gap for _name, gap in order] == sorted(gap for _name, gap in order)
    tick_live(now=timezone.now())


@pytest.mark.parametrize("without", ["WebGL", "its context"])
def test_a_live_page_plays_on_the_map_without(opened, without):
    page = opened(viewport={"width": 360, "height": 740}, camera="map" if without == "WebGL" else "chase")
    if without == "WebGL":
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        page.reload()
        playwright.expect(page.locator('[data-car="3"]')).to_be_visible()
        playwright.expect(page.locator("[data-cameras]")).to_be_hidden()
    else:
        page.wait_for_function(IN_3D)
        page.locator("[data-stage]").press("c")
        playwright.expect(page.locator("[data-camera]")).to_have_value("onboard")
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        lose = "document.querySelector('[data-scene]').getContext('webgl2').getExtension('WEBGL_lose_context')"
        page.evaluate(f"window.lost = {lose}; lost.loseContext()")
        playwright.expect(page.locator("[data-note]")).to_have_text("The 3D view stopped. The map goes on.")
    playwright.expect(page.locator("[data-scene]")).to_be_hidden()
    car = page.locator('[data-car="0"]')
    playwright.expect(car).not_to_have_attribute("style", car.get_attribute("style"))
    assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_with_reduced_motion_cars_go_from_place_to_place(opened):
    page = opened(reduced_motion="reduce", camera="map")
    page.wait_for_function("() => document.querySelector('[data-show]').show.replay.runs.length > 1")
    moments = page.evaluate(
        """() => {
          const { show } = document.querySelector("[data-show]"), now = show.clock.now();
          return [0, 1, 400, 999].map((ms) => { show.clock.now = () => now + ms; return show.moment(); });
        }"""
    )
    assert all(moment % 1000 == 0 for moment in moments)


def test_eight_cars_are_within_a_centimetre_of_their_chunks(browser, db):
    track = track_of("reinvent-2018")
    results = [drive(track, RaceRules(laps=1), speed=1.6 + 0.1 * at, offset=0.05 * (at - 4)) for at in range(8)]
    cars = [{"number": number, **trace_columns(result.trace.to_csv())} for number, result in enumerate(results)]
    chunks = cut(cars, [], {number: [lap.to_dict() for lap in result.laps] for number, result in enumerate(results)})
    page = browser.new_page(viewport={"width": 400, "height": 300})
    open_scripts(page)
    names = [f"car {number}" for number in range(8)]
    told = page.evaluate(
        EIGHT, {"scene": scene_document(track, "ccw"), "chunks": list(chunks), "names": names, "long": CHUNK_MS}
    )
    where = {(car["number"], t): (x, y) for car in cars for t, x, y in zip(car["t"], car["x"], car["y"], strict=True)}
    assert {(car, t) for car, t, *_ in told["places"]} == set(where)
    over = [result.laps[0].time_ms for result in results]  # there it stands; its last step is a little beyond
    for car, t, *place in told["places"]:
        assert t > over[car] or math.dist(place, where[car, t]) < NEAR_M, (car, t)
    by_time = sorted(range(8), key=lambda number: results[number].laps[0].time_ms)
    assert [name for name, *_ in told["order"]] == [names[number] for number in by_time]
    assert all(complete for _name, complete, _gap in told["order"])
    first = results[by_time[0]].laps[0].time_ms
    gaps = [results[number].laps[0].time_ms - first for number in by_time]
    assert [gap for *_, gap in told["order"]] == pytest.approx(gaps, abs=1)
    page.close()
