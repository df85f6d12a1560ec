"""The viewer of replays in a real Chromium: positions at every step, clock, controls and address."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from urllib.parse import parse_qs, urlsplit

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.running.results import read_trace
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, SHOTS, chromium, shoot, visitor

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
WITHIN_M = 0.01
# events and cameras are offered then
PAINTED = "performance.getEntriesByName('viewer:painted').length > 0"
POSITIONS = """async (address) => {
    const { Run, turn } = await import(address);
    const answer = await fetch(document.querySelector('[data-viewer]').viewer.setup.runs[0].url);
    const run = new Run(await answer.json());
    return run.columns.t.map((ms) => { const { x, y, yaw } = run.at(ms); return [x, y, yaw]; });
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


@pytest.fixture
def pair(alice, wakes):
    now = timezone.now()
    race = a_race(now, slug="open", name="Open race")
    return a_driven_run(race, alice, now, lap_ms=9_000), a_driven_run(race, a_racer("bob"), now, lap_ms=8_000)


@pytest.fixture
def open_page(browser, live_server, alice):
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))

        def goto(address: str, camera: str = "map"):
            """``camera``: the reader's choice; three dimensions take two thirds of the processor time."""
            page.add_init_script(f"localStorage.setItem('viewer-camera', '{camera}')")
            page.goto(address)
            playwright.expect(page.locator("[data-player]")).to_be_visible()
            page.wait_for_function(PAINTED)
            return page

        yield goto
        assert not errors


def beside(mine, theirs, more: str = "") -> str:
    return f"{reverse('replay', args=[mine.public_id])}?with={theirs.public_id}{more}"


def test_every_car_is_where_its_trace_says_at_every_step(open_page, pair):
    page = open_page(reverse("replay", args=[pair[0].public_id]))
    shown = page.evaluate(POSITIONS, "/static/viewer/store.js")
    rows = list(csv.DictReader(io.StringIO(read_trace(pair[0].result).decode())))
    assert len(shown) == len(rows) > 100
    for (x, y, yaw), row in zip(shown, rows, strict=True):
        assert abs(x - float(row["X"])) < WITHIN_M and abs(y - float(row["Y"])) < WITHIN_M
        assert abs((yaw - float(row["yaw"]) + 180) % 360 - 180) < 0.1


def test_a_car_turns_the_short_way_and_does_not_glide_over_a_reset(open_page, pair):
    page = open_page(reverse("replay", args=[pair[0].public_id]))
    columns = {
        **{"t": [0, 100, 200, 300], "x": [0, 0.1, 5, 5.1], "y": [0] * 4, "yaw": [170, -170, -170, 175]},
        **{"v": [1] * 4, "steer": [0] * 4, "lap": [1] * 4, "status": ["in_progress"] * 4},
        **{"progress": [0, 1, 0.5, 2], "on_track": [True] * 4},
    }
    script = """async (columns) => {
        const { Run } = await import('/static/viewer/store.js');
        const run = new Run({ columns, laps: [], look: {} });
        return [50, 150, 250].map((ms) => { const { x, yaw } = run.at(ms); return [x, yaw]; });
    }"""
    (x, yaw), (jumped_x, _), (_, back) = page.evaluate(script, columns)
    assert x == pytest.approx(0.05) and abs(yaw) == pytest.approx(180)
    assert jumped_x == pytest.approx(0.1), "it stays until the step of the reset"
    assert (back + 360) % 360 == pytest.approx(182.5)


def test_both_clocks_begin_at_the_line_and_the_tower_has_the_gap(open_page, pair):
    page = open_page(beside(*pair))
    page.locator("[data-seek]").fill("4000")
    rows = page.locator("[data-tower] tbody tr")
    playwright.expect(rows).to_have_count(2)
    playwright.expect(rows.nth(0)).to_contain_text("bob")
    playwright.expect(rows.nth(1)).to_contain_text("alice")
    # bob drives a lap in 8 s, alice in 9: where alice is after 4 s, bob was after 4 * 8 / 9
    gap = float(rows.nth(1).locator("td").nth(3).text_content())
    assert gap == pytest.approx(4 - 4 * 8 / 9, abs=0.07)
    playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 2 · 0:04.000")
    page.locator("[data-seek]").fill("8999")
    playwright.expect(rows.nth(1).locator("td").nth(3)).to_have_text("+1.000")


def test_keys_step_jump_and_play(open_page, pair):
    page = open_page(beside(*pair))
    stage, seek = page.locator("[data-stage]"), page.locator("[data-seek]")
    stage.focus()
    page.keyboard.press("ArrowRight")
    step = int(seek.input_value())
    assert 0 < step <= 67
    page.keyboard.press("ArrowRight")
    assert int(seek.input_value()) - step in (66, 67)
    page.keyboard.press("ArrowLeft")
    assert int(seek.input_value()) == step
    page.keyboard.press("d")
    assert int(seek.input_value()) > step, "to where the other gains"
    page.keyboard.press("End")
    assert seek.input_value() == seek.get_attribute("max")
    page.keyboard.press("Home")
    page.keyboard.press("]")
    playwright.expect(page.locator("[data-rate]")).to_have_value("2")
    for _ in range(4):
        page.keyboard.press("[")
    playwright.expect(page.locator("[data-rate]")).to_have_value("0.1")  # it is not over before the next key
    page.keyboard.press(" ")
    playwright.expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.keyboard.press("k")
    playwright.expect(page.get_by_role("button", name="Play")).to_be_visible()
    assert 0 < int(seek.input_value()) < 8999


def test_a_link_to_a_moment_opens_there(open_page, pair):
    page = open_page(beside(*pair, "&t=3.2&lap=3&camera=map"))
    playwright.expect(page.locator("[data-seek]")).to_have_value("3200")
    playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 3 · 0:03.200")
    page.locator("[data-stage]").focus()
    page.keyboard.press("ArrowRight")
    address = page.evaluate("document.querySelector('[data-viewer]').viewer.address")
    query = parse_qs(urlsplit(address).query)
    assert (
        query["with"] == [pair[1].public_id]
        and query["lap"] == ["3"]
        and float(query["t"][0]) == pytest.approx(3.2, abs=0.1)
    )


def test_runs_are_added_and_removed_and_their_laps_chosen(open_page, pair):
    page = open_page(reverse("replay", args=[pair[0].public_id]))
    row = page.locator("#offers").get_by_role("row").filter(has_text="bob")
    playwright.expect(row).to_contain_text("leads")
    row.get_by_role("link").first.focus()
    page.keyboard.press("Enter")
    playwright.expect(page.get_by_role("heading", level=1)).to_contain_text("alice – bob")
    playwright.expect(page.get_by_text("bob is 1.000 s ahead of alice at the line.")).to_be_visible()
    page.get_by_label("alice", exact=True).select_option(label=None, value="3")
    page.get_by_role("button", name="Compare").last.click()
    playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 3 ·")
    if SHOTS:
        page.locator("[data-seek]").fill("4000")
        shoot(page, "replay")
    page.get_by_role("link", name="Remove bob").click()
    playwright.expect(page.get_by_role("heading", level=1)).to_have_text("alice")


def test_the_run_page_plays_its_run(open_page, pair):
    page = open_page(pair[0].get_absolute_url())
    page.locator("[data-seek]").fill("12000")
    playwright.expect(page.locator("[data-out]")).to_contain_text("Lap 2 · 0:03")
    if SHOTS:
        shoot(page, "run")


def test_a_run_that_cannot_be_loaded_is_named_and_the_others_play(browser, live_server, alice, pair):
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        page.route("**/replay.json?with=*", lambda route: route.fulfill(status=503, body="{}"))
        page.route(f"**/{pair[1].public_id}/replay.json", lambda route: route.fulfill(status=503, body="{}"))
        page.goto(beside(*pair))
        playwright.expect(page.locator("[data-note]")).to_have_text(
            "bob is missing: its replay could not be loaded.", timeout=20_000
        )
        playwright.expect(page.locator("[data-player]")).to_be_visible()
        page.route(f"**/{pair[0].public_id}/replay.json", lambda route: route.fulfill(status=503, body="{}"))
        page.reload()
        playwright.expect(page.locator("[data-note]")).to_have_text("The replay could not be loaded.")


def test_without_scripts_the_page_has_map_sentence_and_tables(browser, live_server, alice, pair):
    options = {"java_script_enabled": False, "viewport": {"width": 360, "height": 740}}
    with visitor(browser, live_server.url, alice, **options) as context:
        page = context.new_page()
        page.goto(reverse("replay", args=[pair[0].public_id]))
        page.get_by_label("Any other, by its link").fill(live_server.url + pair[1].get_absolute_url())
        page.get_by_role("button", name="Add").click()
        page.get_by_role("link", name="Who is ahead, and where").click()
        playwright.expect(page.get_by_text("bob is 1.000 s ahead of alice at the line.")).to_be_visible()
        playwright.expect(page.get_by_role("region", name="Laps and sectors")).to_be_visible()
        playwright.expect(page.locator("[data-player]")).to_be_hidden()


def test_a_car_has_one_colour_everywhere(browser, live_server, alice, pair):
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            page.goto(beside(*pair, "&camera=map"))
            playwright.expect(page.locator("[data-tower] .dot")).to_have_count(2)
            style = "(each, name) => getComputedStyle(each)[name]"
            colours = []
            for number in (0, 1):
                body = page.locator(f'[data-car="{number}"] .above-body').evaluate(style, "fill")
                assert page.locator(".viewer-runs .shell-body").nth(number).evaluate(style, "fill") == body
                assert page.locator(".flat-line").nth(number).evaluate(style, "stroke") == body
                assert page.locator(f'[data-run="{number}"] .dot').evaluate(style, "backgroundColor") == body
                colours.append(body)
            assert colours[0] != colours[1]


def test_cameras_change_and_a_lost_context_leaves_the_map(open_page, pair):
    page = open_page(beside(*pair), camera="")
    camera = page.locator("[data-camera]")
    playwright.expect(camera).to_have_value("chase")
    playwright.expect(page.locator("[data-scene]")).to_be_visible()
    camera.select_option("onboard")
    page.locator("[data-stage]").focus()
    page.keyboard.press("c")
    playwright.expect(camera).to_have_value("top")
    page.evaluate("document.querySelector('[data-viewer]').viewer.mounting.then(() => true)")
    lose = "document.querySelector('[data-scene]').getContext('webgl2').getExtension('WEBGL_lose_context')"
    page.evaluate(f"window.lost = {lose}; lost.loseContext()")
    playwright.expect(page.locator("[data-note]")).to_have_text("The 3D view stopped. The map goes on.")
    playwright.expect(page.locator("[data-scene]")).to_be_hidden()
    before = page.locator('[data-car="0"]').get_attribute("style")
    page.locator("[data-seek]").fill("4000")
    assert page.locator('[data-car="0"]').get_attribute("style") != before
    page.evaluate("lost.restoreContext()")
    playwright.expect(camera).to_have_value("top")
    playwright.expect(page.locator("[data-scene]")).to_be_visible()


def test_without_webgl_the_map_has_the_same_controls(browser, live_server, alice, pair):
    with visitor(browser, live_server.url, alice, viewport={"width": 360, "height": 740}) as context:
        page = context.new_page()
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        page.goto(beside(*pair))
        playwright.expect(page.locator("[data-player]")).to_be_visible()
        playwright.expect(page.locator("[data-cameras]")).to_be_hidden()
        playwright.expect(page.locator("svg.flat-map")).to_be_visible()
        page.locator("[data-seek]").fill("4000")
        playwright.expect(page.locator("[data-tower] tbody tr")).to_have_count(2)
        assert page.evaluate("document.documentElement.scrollWidth") <= 360


def test_a_clip_of_this_moment_has_lap_moment_and_camera_filled_in(open_page, pair):
    mine, theirs = pair
    page = open_page(beside(mine, theirs, "&lap=2&t=4.5&camera=onboard"))
    playwright.expect(page.locator("[data-camera]")).to_have_value("onboard")
    page.get_by_role("link", name="Clip of this moment").click()
    form = page.locator("#video form")
    playwright.expect(form.get_by_label("From (s)")).to_be_visible()
    start_s = mine.result.laps[1]["start_ms"] / 1000
    typed = [float(form.get_by_label(name).input_value()) for name in ("From (s)", "To (s)")]
    assert typed == pytest.approx([start_s + 2.0, start_s + 7.0], abs=0.02)
    values = [form.locator(f"[name={name}]").input_value() for name in ("what", "camera")]
    assert values == ["0:2", "onboard"]


def test_the_viewer_fills_the_screen_by_button_and_key(open_page, pair):
    page = open_page(beside(*pair))
    before = page.locator("[data-stage]").bounding_box()
    page.get_by_role("button", name="Full screen").click()
    page.wait_for_function("() => document.fullscreenElement?.matches('[data-viewer]')")
    playwright.expect(page.get_by_role("button", name="Play")).to_be_in_viewport()
    assert page.locator("[data-stage]").bounding_box()["width"] > before["width"]
    page.locator("[data-stage]").focus()
    page.keyboard.press("f")
    page.wait_for_function("() => document.fullscreenElement === null")


def test_in_three_dimensions_the_tower_lies_over_the_picture(open_page, pair):
    page = open_page(beside(*pair, "&camera=chase"))
    playwright.expect(page.locator("[data-scene]")).to_be_visible()
    stage, tower = (page.locator(part).bounding_box() for part in ("[data-stage]", "[data-tower]"))
    assert stage["x"] < tower["x"] and tower["x"] + tower["width"] < stage["x"] + stage["width"] / 2
    assert stage["y"] < tower["y"] and tower["y"] + tower["height"] < stage["y"] + stage["height"]
    playwright.expect(page.locator("[data-tower] td:nth-child(5)").nth(1)).to_be_visible()
