"""A visitor drives in a real Chromium: the car against the simulator's, the referee, keys, ghosts, phones."""

from __future__ import annotations

import csv
import math
import random
import re
from collections.abc import Iterator
from dataclasses import asdict
from datetime import timedelta

import pytest
from django.utils import timezone

from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.world import World
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.pages.viewer_documents import open_scripts, scene_document, track_of
from tests.shared import SHARED, needs_shared
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]

STEPS = 75  # 5 s
NEAR_M = 0.02
TRACES = ("a-to-z-2023-evaluation", "spain-2026-training-0", "spain-2026-training-1")
Commands = list[tuple[float, float]]

DRIVEN = """async ({physics, drives}) => {
  const { DrivenCar } = await import("/static/viewer/car.js");
  return drives.map((commands) => {
    const car = new DrivenCar(physics, { x: 0, y: 0, yaw: 0 });
    for (const [steering, speed] of commands) car.step(steering, speed);
    return [car.x, car.y, car.yaw];
  });
}"""
JUDGED = """async ({scene, physics, steering, speed, steps}) => {
  const [{ DrivenCar }, { DrivingReferee, Road }] = await Promise.all(
    ["car.js", "driving-referee.js"].map((name) => import(`/static/viewer/${name}`)));
  const road = new Road(scene), referee = new DrivingReferee(road, physics, 2000);
  const car = new DrivenCar(physics, referee.start);
  referee.put(car);
  const seen = [];
  for (let n = 0; n < steps; n += 1) {
    if (referee.pause > 0) { referee.wait(); continue; }
    // straight on, or along the centre line
    let angle = steering;
    if (angle === null) {
      const at = road.project(car.x, car.y, referee.place.index), aim = road.pose(at.metres + 0.55, 0);
      const turn = Math.atan2(aim.y - car.y, aim.x - car.x) - car.yaw;
      angle = Math.atan2(Math.sin(turn), Math.cos(turn)) * 100;
    }
    car.step(angle, speed);
    const found = referee.judge(car);
    if (!found) continue;
    const wheels = referee.wheels(car).filter(([x, y]) => road.contains(x, y)).length;
    const { metres, lastMs: lapMs, pause } = referee;
    seen.push({ step: n, kind: found.kind, wheels, metres, lapMs, pause, back: found.back });
    if (found.back) car.place(found.back);
  }
  return { seen, length: road.length };
}"""


@pytest.fixture
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def scripts(browser) -> Iterator:
    page = browser.new_page()
    open_scripts(page)
    yield page
    page.close()


def simulated(commands: Commands) -> tuple[float, float]:
    with World() as world:
        car = world.add_car()
        for steering, speed in commands:
            car.command(steering, speed)
            world.step()
        return car.pose.x, car.pose.y


def misses(page, drives: list[Commands]) -> list[float]:
    """Metres between the script's car and the simulator's after 5 s, the least first."""
    found = page.evaluate(DRIVEN, {"physics": asdict(PADDOCK_CAR), "drives": drives})
    return sorted(math.dist(place[:2], simulated(drive)) for place, drive in zip(found, drives, strict=True))


def test_a_smoothly_driven_car_ends_within_two_centimetres_of_the_simulators(scripts):
    """Of 12 drives of 5 s at up to 2.5 m/s, nine in ten."""
    draw, drives = random.Random(5), []
    for _ in range(12):
        steering, speed, drive = 0.0, 1.5, []
        for _ in range(STEPS):
            steering = max(-30.0, min(30.0, steering + draw.uniform(-8, 8)))
            speed = max(0.1, min(2.5, speed + draw.uniform(-0.3, 0.3)))
            drive.append((steering, speed))
        drives.append(drive)
    found = misses(scripts, drives)
    assert found[10] < NEAR_M
    assert found[-1] < 2 * NEAR_M


@needs_shared
@pytest.mark.parametrize("name", TRACES)
def test_recorded_commands_end_within_two_centimetres(scripts, name):
    """Of 20 drives of 5 s, nine in ten; the commands of the training jump in each step, and none is far off."""
    with (SHARED / "traces" / f"{name}.csv").open(newline="") as file:
        rows = [(float(row["steer"]), float(row["throttle"])) for row in csv.DictReader(file)]
    starts = range(0, len(rows) - STEPS, (len(rows) - STEPS) // 20)
    found = misses(scripts, [rows[start : start + STEPS] for start in starts][:20])
    assert found[17] < NEAR_M
    assert found[-1] < 2 * NEAR_M


def judged(page, slug: str = "reinvent-2018", **options: object) -> dict:
    track = track_of(slug)
    scene = scene_document(track, track.direction)
    return page.evaluate(JUDGED, {"scene": scene, "physics": asdict(PADDOCK_CAR), "steering": None, **options})


def test_a_lap_along_the_centre_line_is_timed_without_a_fault(scripts):
    found = judged(scripts, speed=1.2, steps=500)
    assert [each["kind"] for each in found["seen"]] == ["lap", "lap"]
    first, second = (each["lapMs"] for each in found["seen"])
    pace = found["length"] / (1.2 * PADDOCK_CAR.speed_gain) * 1000
    assert first == pytest.approx(pace, rel=0.06) and second == pytest.approx(pace, rel=0.04)


def test_a_lap_of_an_open_track_ends_at_its_finish_and_begins_at_its_start(scripts):
    found = judged(scripts, "straight-track", speed=1.2, steps=170)
    geometry = track_of("straight-track")
    assert found["length"] == pytest.approx(geometry.length, abs=0.01)
    assert [each["kind"] for each in found["seen"]] == ["lap", "lap"]
    assert all(
        math.dist((each["back"]["x"], each["back"]["y"]), geometry.point_at(0.0)[:2]) < 0.01 for each in found["seen"]
    )


def test_a_car_off_the_track_waits_and_is_put_back_where_it_left(scripts):
    found = judged(scripts, steering=0, speed=2.0, steps=200)["seen"]
    assert found and all(each["kind"] == "off_track" and each["wheels"] == 0 for each in found)
    assert found[0]["pause"] == 30  # 2 s
    geometry = track_of("reinvent-2018").in_direction("ccw")
    for each in found:
        place = geometry.project(each["back"]["x"], each["back"]["y"])
        left, right = geometry.half_widths_at(place.distance)
        assert min(abs(place.offset - left / 2), abs(place.offset + right / 2)) < 0.03
        assert abs(math.remainder(place.heading - each["back"]["yaw"], 2 * math.pi)) < 0.2
    assert found[1]["step"] - found[0]["step"] > 30


@pytest.mark.parametrize(("width", "theme"), only([(360, "dark")], [(360, "dark"), (1280, "light")]))
def test_a_visitor_drives_against_a_ghost(browser, live_server, width, theme):
    from playwright.sync_api import expect

    race = a_race(timezone.now())
    run = a_driven_run(race, a_racer("alice"), timezone.now() - timedelta(minutes=5), lap_ms=12_000)
    wrong: list[str] = []
    context = visitor(browser, live_server.url, viewport={"width": width, "height": 740}, has_touch=width < 500)
    context.add_cookies([{"name": "theme", "value": theme, "url": live_server.url}])
    page = context.new_page()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)

    page.goto(f"/tracks/{race.track.slug}/")
    page.get_by_role("link", name="Drive it yourself").click()
    page.wait_for_selector("[data-drive][data-ready]", timeout=60_000)
    expect(page.get_by_role("status")).to_contain_text("Hold ▲" if width < 500 else "up arrow")
    assert page.get_by_label("Ghost").input_value().endswith(f"{run.public_id}/replay.json")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("[data-time]").text_content() == "0:00.000"

    page.keyboard.down("ArrowUp")
    expect(page.locator("[data-speed]")).to_have_text(re.compile(r"^[1-4]\."), timeout=60_000)
    expect(page.locator("[data-gap]")).to_contain_text(".")
    moved = page.evaluate("document.querySelector('[data-drive]').drive.referee.metres")
    assert moved > 0.2  # it stood with its nose at 0.14
    # straight on it leaves the road, waits and is put back
    expect(page.get_by_role("status")).to_contain_text("Off track", timeout=60_000)
    page.keyboard.up("ArrowUp")
    page.get_by_role("button", name="Back to the start").click()
    expect(page.locator("[data-time]")).to_have_text("0:00.000")
    page.get_by_label("Ghost").select_option("")
    expect(page.locator("[data-gap]")).to_have_text("")
    assert not wrong


def test_a_page_without_webgl_is_driven_on_the_map(browser, live_server):
    from playwright.sync_api import expect

    race = a_race(timezone.now())
    page = visitor(browser, live_server.url).new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(f"/tracks/{race.track.slug}/drive/?ghost=none")
    page.wait_for_selector("[data-drive][data-ready]")
    assert page.locator("[data-scene]").is_hidden()
    before = page.locator('[data-car="0"]').get_attribute("style")
    page.keyboard.down("w")
    expect(page.locator('[data-car="0"]')).not_to_have_attribute("style", before)


DRIVE = "document.querySelector('[data-drive]').drive"
PHONE = {"has_touch": True, "is_mobile": True, "viewport": {"width": 360, "height": 740}}
STUB_PAD = """window.pad = { axes: [0, 0, 0, 0], buttons: Array.from({ length: 16 }, () => ({ value: 0 })) };
navigator.getGamepads = () => [null, window.pad];"""


def driving_page(browser, site: str, script: str = "", **context):
    """The page without a ghost, on the map, ready to drive."""
    race = a_race(timezone.now())
    page = visitor(browser, site, **context).new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;" + script)
    page.goto(f"/tracks/{race.track.slug}/drive/?ghost=none")
    page.wait_for_selector("[data-drive][data-ready]")
    return page


def test_a_gamepad_steers_with_its_stick_and_drives_with_its_triggers(browser, live_server):
    page = driving_page(browser, live_server.url, STUB_PAD)
    lock, most = PADDOCK_CAR.max_steering_deg, PADDOCK_CAR.max_speed

    def pad(stick: float, gas: float, brake: float = 0.0) -> list[float]:
        """The commands after a second with the stick and the triggers so."""
        return page.evaluate(
            f"""([stick, gas, brake]) => {{
                window.pad.axes[0] = stick;
                [window.pad.buttons[7].value, window.pad.buttons[6].value] = [gas, brake];
                return {DRIVE}.controls.read(1);
            }}""",
            [stick, gas, brake],
        )

    assert pad(-1.0, 0.0)[0] == pytest.approx(lock) and pad(1.0, 0.0)[0] == pytest.approx(-lock)
    assert 0 < pad(-0.5, 0.0)[0] < lock / 2  # fine around the middle
    assert pad(0.05, 0.0)[0] == pytest.approx(0.0, abs=0.5)  # a stick never rests at zero
    page.evaluate(f"{DRIVE}.restart()")
    assert not page.evaluate(f"{DRIVE}.controls.touched")
    assert pad(0.0, 1.0)[1] == pytest.approx(most)
    page.wait_for_function(f"() => {DRIVE}.running && {DRIVE}.referee.metres > 0.2")  # the trigger started the car
    assert pad(0.0, 0.0, 1.0)[1] == pytest.approx(PADDOCK_CAR.min_speed)


def test_a_tilted_phone_steers(browser, live_server):
    from playwright.sync_api import expect

    page = driving_page(browser, live_server.url, **PHONE, permissions=["accelerometer", "gyroscope"])
    lock = PADDOCK_CAR.max_steering_deg

    def steering(beta: float, gamma: float) -> float:
        """The command after the phone was turned by these degrees."""
        return page.evaluate(
            f"""([beta, gamma]) => {{
                dispatchEvent(new DeviceOrientationEvent("deviceorientation", {{ alpha: 0, beta, gamma }}));
                return {DRIVE}.controls.read(1)[0];
            }}""",
            [beta, gamma],
        )

    assert steering(0, -20) == 0.0  # not before it was asked for
    button = page.get_by_role("button", name="Steer by tilting")
    button.tap()
    expect(button).to_have_attribute("aria-pressed", "true")
    assert steering(0, -14) == pytest.approx(lock / 2) and steering(0, 14) == pytest.approx(-lock / 2)
    assert steering(0, -80) == pytest.approx(lock)
    page.evaluate("Object.defineProperty(screen.orientation, 'angle', { value: 90 })")  # held across
    assert steering(-14, 0) == pytest.approx(lock / 2)
    page.evaluate("delete screen.orientation.angle")
    button.tap()
    expect(button).to_have_attribute("aria-pressed", "false")
    assert abs(steering(0, -20)) < lock / 2


def test_a_refused_tilt_is_a_sentence_on_the_page(browser, live_server):
    from playwright.sync_api import expect

    denied = "DeviceOrientationEvent.requestPermission = async () => 'denied';"
    page = driving_page(browser, live_server.url, denied, **PHONE)
    button = page.get_by_role("button", name="Steer by tilting")
    button.tap()
    expect(page.get_by_role("status")).to_have_text(
        "The browser does not allow this page to read the tilt of the phone."
    )
    expect(button).to_have_attribute("aria-pressed", "false")


def test_pedals_under_a_thumb_drive_and_the_page_says_so(browser, live_server):
    page = driving_page(browser, live_server.url, **PHONE)
    assert "Hold ▲ to start." in page.get_by_role("status").inner_text()
    assert page.get_by_text("Hold ◀ and ▶ to steer").is_visible() and page.get_by_text("Space brakes").is_hidden()
    for button in page.locator("[data-hold], [data-again], select:visible").all():
        box = button.bounding_box()
        assert min(box["width"], box["height"]) >= 44
    faster = page.locator("[data-hold=faster]")
    faster.dispatch_event("pointerdown", {"pointerId": 1, "bubbles": True})
    page.wait_for_function(f"() => {DRIVE}.referee.metres > 0.2")


def test_keys_drive_after_a_button_was_pressed_and_space_brakes(browser, live_server):
    page = driving_page(browser, live_server.url)
    assert page.get_by_text("Space brakes").is_visible()
    page.get_by_role("button", name="Back to the start").click()
    page.keyboard.down("ArrowUp")
    page.wait_for_function(f"() => {DRIVE}.car.speed > 1.2")
    page.keyboard.up("ArrowUp")
    page.locator("[data-stage]").focus()
    page.keyboard.down(" ")
    page.wait_for_function(f"() => {DRIVE}.controls.speed === {PADDOCK_CAR.min_speed}")


def test_without_scripts_the_page_has_the_track_and_no_dead_controls(browser, live_server):
    race = a_race(timezone.now())
    page = visitor(browser, live_server.url, java_script_enabled=False).new_page()
    page.goto(f"/tracks/{race.track.slug}/drive/")
    assert "Driving needs JavaScript." in page.locator("main noscript p").inner_text()
    assert page.locator("main noscript svg").is_visible()
    assert not [one for one in page.locator("main button, main select").all() if one.is_visible()]
