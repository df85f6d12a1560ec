"""A car is driven for oneself, in a real browser: from the track's page to the result, again, and deleted."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.utils import timezone

from evaluation.running.queue.jobs import finish_evaluation
from races.models import OwnEvaluation
from tests.factories import a_model, a_racer, a_track, laps, outcome, start
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.rows import track_row

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with chromium() as opened:
        yield opened


def choose(page, label: str, keys: str) -> None:
    """Walk to a field with the tabulator, from wherever the focus is, and type."""
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate(
            "label => [...(document.activeElement.labels || [])].some(l => l.innerText.trim().startsWith(label))", label
        ):
            break
    else:
        raise AssertionError(f"the tabulator does not come to {label}")
    page.keyboard.type(keys)


def is_layout(answer) -> bool:
    return answer.url.endswith("/runs/layout/")


def test_a_car_is_driven_from_the_page_of_a_track(browser, live_server, alice, wakes):
    now = timezone.now()
    a_model(alice, name="Lightning")
    a_model(a_racer("house-flyer", is_house=True), name="Flyer")
    track = a_track()
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        page.goto(f"/tracks/{track.slug}/")
        page.get_by_role("link", name="Test drive here").click()

        # the fields by the keyboard alone
        choose(page, "Model", "Fly")
        page.keyboard.press("Tab")  # into the types of race
        page.keyboard.press("ArrowRight")
        assert page.get_by_label("object avoidance").is_checked()
        drawing = page.locator("[data-places] svg").first
        drawing.wait_for()
        choose(page, "Laps driven", "")
        page.keyboard.press("Control+A")
        page.keyboard.type("2")
        with page.expect_response(is_layout):  # else the map is replaced while it is clicked on
            page.keyboard.press("Tab")
        page.wait_for_function("() => !document.querySelector('.htmx-request, .htmx-swapping, .htmx-settling')")

        # boxes by a click on the map, in a lane; a click on one takes it away
        place = """(map, [lane, index]) => {
          const point = new DOMPoint(...JSON.parse(map.closest("[data-places]").dataset.places)[lane][index]);
          const at = point.matrixTransform(map.getScreenCTM());
          return [at.x, at.y];
        }"""
        drawing.scroll_into_view_if_needed()
        for lane, index, boxes in (("inner", 60, 1), ("outer", 100, 2), ("inner", 60, 1)):
            with page.expect_response(is_layout):
                page.mouse.click(*drawing.evaluate(place, [lane, index]))
            page.wait_for_function("count => document.querySelectorAll('.layout-boxes li').length === count", arg=boxes)
        page.get_by_role("button", name="Drive", exact=True).press("Enter")
        page.wait_for_url("**/evaluations/*/")

        own = OwnEvaluation.objects.get()
        assert own.evaluation.model.name == "Flyer" and own.rules.laps == 2
        assert [(round(box.fraction, 3), box.lane) for box in own.rules.boxes] == [(0.5, "outer")]
        run = start(own.evaluation, now)
        finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome(laps(9_000, 10_000)), now=now)
        page.get_by_text("Average of 2 laps").wait_for()
        assert page.locator("#worth .big-time").inner_text() == "0:09.500"

        page.get_by_role("button", name="Run again").press("Enter")
        page.get_by_role("heading", name="In queue").wait_for()
        assert OwnEvaluation.objects.count() == 2
        page.get_by_role("button", name="Stop").press("Enter")
        page.get_by_role("link", name="Delete").press("Enter")
        page.get_by_role("button", name="Delete").press("Enter")
        page.get_by_text("Run deleted.").wait_for()
        assert list(OwnEvaluation.objects.filter(deleted_at=None)) == [own]


def test_another_track_renames_the_directions(browser, live_server, alice):
    a_model(alice)
    a_track()
    straight = track_row("straight-track")
    with visitor(browser, live_server.url, alice) as context:
        page = context.new_page()
        page.goto("/runs/new/?track=oval")
        said = "() => [...document.querySelector('select[name=direction]').options].map(way => way.text)"
        assert page.evaluate(said) == ["counter-clockwise", "clockwise"]
        page.get_by_label("Track", exact=True).select_option(straight.slug)
        assert set(page.evaluate(said)) == {"from start to end", "from end to start"}
        page.get_by_label("Track", exact=True).select_option("oval")
        assert page.evaluate(said) == ["counter-clockwise", "clockwise"]
