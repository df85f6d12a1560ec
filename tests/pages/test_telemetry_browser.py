"""Telemetry beside a replay in a real Chromium: one cursor, zoom, keys, the moments of losses, its file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from urllib.parse import parse_qs, urlencode, urlsplit

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.submissions import submit_model
from tests.factories import a_model, a_race, a_racer, outcome, start, track_row
from tests.paddock.analysis.mistakes import SLOW, drive, track_named
from tests.pages.browsing import IN_A_BROWSER, SHOTS, chromium, shoot, visitor
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]
SLUG = "reinvent-2018"
CURSOR = "document.querySelector('[data-telemetry]').telemetry"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def a_simulated_run(race, racer, now, run):
    """A finished run with the laps and the trace of a run of the simulator."""
    evaluation = start(submit_model(race=race, racer=racer, model=a_model(racer), now=now).evaluation, now)
    driven = replace(outcome([lap.to_dict() for lap in run.laps]), trace_csv=run.trace.to_csv())
    assert finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=driven, now=now)
    evaluation.refresh_from_db()
    return evaluation


@pytest.fixture
def pair(alice, wakes):
    """A run that is slow in turn 4 of its second lap, and one that is not."""
    now = timezone.now()
    race = a_race(now, slug="open", name="Open race", track=track_row(SLUG), laps=2, minimum_laps=2)
    slow = drive(SLUG, SLOW, track_named(SLUG)[1][3])
    return a_simulated_run(race, alice, now, slow), a_simulated_run(race, a_racer("bob"), now, drive(SLUG))


@pytest.fixture
def open_page(browser, live_server, alice, pair):
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        # three dimensions take two thirds of the processor time, and show nothing of the charts
        page.add_init_script("localStorage.setItem('viewer-camera', 'map')")

        def goto(width: int = 1280, **query: str):
            page.set_viewport_size({"width": width, "height": 900})
            given = {"lap": "2", "with": f"{pair[1].public_id}:2"} | query
            page.goto(f"{reverse('replay', args=[pair[0].public_id])}?{urlencode(given, safe=':,')}")
            page.locator("#analysis").scroll_into_view_if_needed()
            playwright.expect(page.locator("figure[data-chart] canvas").first).to_be_visible()
            return page

        yield goto
        assert not errors


def state(page, what: str):
    return page.evaluate(f"{CURSOR}.{what}")


def test_charts_and_replay_share_one_moment(open_page):
    page = open_page()
    playwright.expect(page.locator("figure[data-chart]")).to_have_count(5)  # no reward
    page.locator("[data-seek]").fill("4000")
    cell = page.locator(".telemetry-values tbody td").first
    playwright.expect(cell).to_have_text("0:04.000")
    over = page.locator("figure[data-chart=speed] .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 40)
    half = state(page, "data.length_m") / 2
    assert state(page, "place") == pytest.approx(half, abs=0.1)
    assert page.locator("[data-seek]").input_value() != "4000"
    if SHOTS:
        shoot(page, "telemetry")


def test_a_loss_leads_to_its_moment(open_page):
    page = open_page()
    loss = page.locator(".telemetry-losses a")
    playwright.expect(loss).to_have_count(1)
    playwright.expect(loss).to_contain_text("lost in turn 4: braked 0.6 m/s too much")
    moment = int(loss.get_attribute("data-moment"))
    loss.click()
    assert int(page.locator("[data-seek]").input_value()) == pytest.approx(moment, abs=2)
    address = parse_qs(urlsplit(loss.get_attribute("href")).query)
    assert float(address["t"][0]) * 1000 == pytest.approx(moment, abs=10)


def test_keys_move_the_cursor_and_zoom(open_page):
    page = open_page()
    page.locator("[data-plots]").focus()
    page.keyboard.press("ArrowRight")
    one = state(page, "place")
    page.keyboard.press("Shift+ArrowRight")
    assert state(page, "place") == pytest.approx(11 * one, rel=0.05)
    page.keyboard.press("+")
    first, last = state(page, "range")
    assert last - first == pytest.approx(state(page, "data.length_m") / 2, rel=0.01)
    page.keyboard.press("PageDown")
    assert state(page, "range[0]") > first
    page.keyboard.press("0")
    assert state(page, "range") == state(page, "whole")
    page.emulate_media(color_scheme="light")
    for script in ("x", f"{CURSOR}.build()", f"{CURSOR}.zoom('in')"):  # the cursor stays at its place
        page.evaluate(f"(async () => {{ const x = 0; {script}; {CURSOR}.showCursor(); }})()")
        ends = page.evaluate(f"{CURSOR}.plots.map(({{ plot }}) => plot.posToVal(plot.cursor.left, 'x'))")
        assert ends == pytest.approx([state(page, "place")] * len(ends), abs=0.05)


def test_a_part_is_zoomed_by_the_pointer_and_is_what_the_file_has(open_page):
    page = open_page()
    over = page.locator("figure[data-chart=delta] .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.25, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + 20, steps=4)
    page.mouse.up()
    length = state(page, "data.length_m")
    first, last = state(page, "range")
    assert (first, last) == (pytest.approx(length / 4, abs=0.2), pytest.approx(length / 2, abs=0.2))
    link = parse_qs(urlsplit(page.locator("[data-csv]").get_attribute("href")).query)
    assert float(link["from"][0]) == pytest.approx(first, abs=0.01)
    with page.expect_download() as download:
        page.locator("[data-csv]").click()
    rows = download.value.path().read_text().splitlines()
    assert first - 0.1 <= float(rows[1].split(",")[2]) <= first + 0.2
    page.locator(".mini-sectors [data-from]").nth(10).click()
    assert state(page, "range[0]") == pytest.approx(length / 2, abs=0.1)


def test_over_time_each_run_has_its_own_clock(open_page, pair):
    page = open_page()
    page.locator("[data-axis]").select_option("time")
    times = [run.result.laps[1]["time_ms"] for run in pair]
    assert state(page, "whole[1]") == pytest.approx(max(times) / 1000, abs=0.01)
    page.locator("[data-seek]").fill("4000")
    assert state(page, "place") == pytest.approx(4.0, abs=0.01)
    cells = page.locator(".telemetry-values tbody tr td:first-of-type")
    playwright.expect(cells.nth(0)).to_have_text("0:04.000")
    playwright.expect(cells.nth(1)).to_have_text("0:04.000")


def test_the_delta_is_to_any_run(open_page, pair):
    page = open_page()
    page.locator("[data-seek]").fill(str(pair[0].result.laps[1]["time_ms"]))
    gap = (pair[1].result.laps[1]["time_ms"] - pair[0].result.laps[1]["time_ms"]) / 1000
    deltas = page.locator(".telemetry-values tbody tr td:nth-of-type(2)")
    playwright.expect(deltas.nth(1)).to_have_text(f"−{-gap:.3f}")
    page.locator("[data-reference]").select_option("1")
    playwright.expect(deltas.nth(0)).to_have_text(f"+{-gap:.3f}")
    playwright.expect(deltas.nth(1)).to_have_text("")


@pytest.mark.parametrize("width", only([360], [360, 1920]))
def test_charts_have_the_width_of_the_page(open_page, width):
    page = open_page(width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    chart = page.locator("figure[data-chart=speed] .uplot").bounding_box()
    assert width * 0.55 <= chart["width"] <= width
    if SHOTS:
        shoot(page, f"telemetry-{width}")


def test_charts_of_a_whole_run_name_their_lap_and_go_with_the_replay(open_page, pair):
    page = open_page(**{"lap": "all", "with": ""})
    laps = pair[0].result.laps
    best = min(laps, key=lambda lap: lap["time_ms"])["number"]
    other = 3 - best
    head = page.locator("[data-shown-lap]")
    playwright.expect(head).to_have_text(f"Lap {best} (best lap)")
    playwright.expect(page.locator("[data-lap]")).to_have_value(str(best))
    times = page.locator(".mini-sectors .sector-time").all_inner_texts()
    page.locator("[data-seek]").fill(str(laps[other - 1]["start_ms"] + 2000))
    playwright.expect(head).to_have_text(f"Lap {other}")
    playwright.expect(page.locator(".telemetry-values tbody td").first).to_have_text("0:02.000")
    assert (
        state(page, "data.runs[0].lap") == other
        and page.locator(".mini-sectors .sector-time").all_inner_texts() != times
    )
    link = parse_qs(urlsplit(page.locator("[data-csv]").get_attribute("href")).query)
    assert link["lap"] == [str(other)] and page.locator("[data-of-lap]").inner_text() == str(other)
    page.locator("[data-lap]").select_option(str(best))
    playwright.expect(head).to_have_text(f"Lap {best} (best lap)")
    assert page.locator(".mini-sectors .sector-time").all_inner_texts() == times
    assert int(page.locator("[data-seek]").input_value()) == pytest.approx(laps[best - 1]["start_ms"], abs=2)


def test_one_run_has_no_delta(open_page):
    page = open_page(**{"lap": "all", "with": ""})
    playwright.expect(page.locator("figure[data-chart]")).to_have_count(4)
    playwright.expect(page.locator(".telemetry-values").get_by_text("Delta")).to_have_count(0)
    page.locator("[data-seek]").fill("3000")
    cells = page.locator(".telemetry-values tbody tr td")
    playwright.expect(cells).to_have_count(4)
    playwright.expect(cells.nth(3)).to_have_text(re.compile(r"^[−-]?\d\.\d\d$"))


def test_mini_sectors_are_chosen_by_keys(open_page):
    page = open_page()
    cells = page.locator(".mini-sectors [data-from]")
    length = state(page, "data.length_m")
    cells.first.focus()
    page.keyboard.press("ArrowRight")
    playwright.expect(cells.nth(1)).to_be_focused()
    page.keyboard.press("Enter")
    assert state(page, "range") == pytest.approx([length / 20, length / 10], abs=0.1)
    playwright.expect(cells.nth(1)).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("ArrowDown")
    playwright.expect(cells.nth(21)).to_be_focused()
    playwright.expect(page.locator(".mini-sectors [tabindex='0']")).to_have_count(1)
    page.keyboard.press("ArrowUp")
    page.keyboard.press(" ")
    assert state(page, "range") == state(page, "whole")
    playwright.expect(page.get_by_role("button", name="Mini-sector 2:")).to_have_count(2)


def test_the_end_of_the_charts_is_that_of_the_first_run(open_page, pair):
    page = open_page()
    page.goto(f"{reverse('replay', args=[pair[1].public_id])}?lap=2&with={pair[0].public_id}:2")
    page.locator("[data-axis]").select_option("time")
    page.locator("[data-plots]").focus()
    page.keyboard.press("End")
    own, slower = (run.result.laps[1]["time_ms"] / 1000 for run in reversed(pair))
    assert state(page, "place") == pytest.approx(own, abs=0.01)
    assert state(page, "whole[1]") == pytest.approx(slower, abs=0.01) and slower > own + 0.1


def test_a_chart_around_zero_has_ticks_on_both_sides(open_page):
    page = open_page()
    for chart in ("offset", "steer", "curvature"):
        plot = f"plots.find((each) => each.chart.name === '{chart}').plot"
        ticks = [tick for tick in state(page, f"{plot}.axes[1]._splits") if tick is not None]
        assert min(ticks) < 0 < max(ticks) and 0 in ticks, chart
