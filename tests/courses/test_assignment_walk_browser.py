"""A teacher and a student walk through an assignment in a real browser: made, published, handed in with a house car's
copy that the worker really drives, marked, given back, regraded, downloaded."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import pytest
from django.core.cache import cache

from accounts.class_accounts.services import add_learners, make_class
from courses.models import Assignment, Attempt, Mark
from evaluation.running.queue.worker import run_next_evaluation
from league.house_cars.services import HOUSE_CARS_DIR
from tests.factories import a_racer, a_track
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor
from tests.soak import only

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

CAR = HOUSE_CARS_DIR / "flyer.onnx"
pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


def fits(page) -> None:
    """Nothing of a page is wider than the window."""
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), page.url


@pytest.mark.parametrize("width", only([360], [360, 1280]))
def test_a_teacher_and_a_student_walk_through_an_assignment(width, live_server, wakes, now):
    cache.clear()
    a_track()
    prof = a_racer("prof")
    room = make_class(teacher=prof, name="6a", plan=[], now=now)
    (card,) = add_learners(classroom=room, by=prof, names=["Kim Minji; 20261"], now=now)
    with chromium() as browser:
        size = {"width": width, "height": 800}
        teacher = visitor(browser, live_server.url, prof, viewport=size).new_page()
        student = visitor(browser, live_server.url, card.learner.racer, viewport=size).new_page()
        errors: list[object] = []
        for page in (teacher, student):
            page.on("pageerror", lambda error: errors.append(error))
        _make(teacher, room)
        _hand_in(student)
        while run_next_evaluation(worker="test"):
            pass
        _look(student)
        _grade(teacher, student)
    assert not errors


def _make(page, room) -> None:
    """From the page of the class: a draft, its part, and published."""
    page.goto(room.get_absolute_url())
    page.get_by_role("link", name="New assignment").click()
    assert page.get_by_label("Class or group").input_value() == room.group.slug
    page.get_by_label("Title").fill("Two laps")
    page.get_by_label("Time zone", exact=True).select_option("Europe/Berlin")
    page.get_by_label("Attempts in all").fill("2")
    page.get_by_label("a board with names").check()
    fits(page)
    page.get_by_role("button", name="Create the draft").click()
    page.get_by_text("Draft created.").wait_for()
    page.get_by_label("Title").fill("Clean laps")
    page.get_by_label("Track", exact=True).select_option("oval")
    page.get_by_label("complete laps in a row").check()
    assert page.get_by_label("Time limit (s)").first.is_hidden(), "values of other rules"
    page.locator("[name=laps_in_row_laps]").fill("2")
    page.locator("[name=laps]").fill("2")
    page.locator("#layout .track-map").wait_for()
    fits(page)
    page.get_by_role("button", name="Add the part").click()
    page.get_by_text("2 complete laps in a row on each track.").wait_for()
    page.get_by_role("button", name="Publish the assignment").click()
    page.get_by_text("Published. The students see it.").wait_for()
    fits(page)


def _hand_in(page) -> None:
    """From the student's first page to the queue."""
    page.goto("/models/upload/")
    page.locator("input[type=file]").set_input_files([str(CAR), str(_metadata())])
    page.get_by_role("button", name="Upload").click()
    page.wait_for_url(re.compile(r"/models/\w{12}/"))
    page.goto("/")
    page.locator("#due").get_by_role("link", name="Two laps").click()
    page.get_by_text("in 13 days").or_(page.get_by_text("in 14 days")).first.wait_for()
    page.locator("#send").get_by_role("button", name="Hand in").click()
    page.get_by_text("Handed in. The runs appear below.").wait_for()
    page.locator("#attempts .pill.queued").first.wait_for()
    fits(page)


def _metadata() -> Path:
    return CAR.with_suffix(".json")


def _look(page) -> None:
    """Each number of the mark stands on the page, and the replay opens."""
    attempts = page.locator("#attempts")
    page.reload()
    attempts.get_by_text("2 laps in a row").wait_for()
    attempts.get_by_text("Passed on every track.").wait_for()
    assert "100 / 100" in page.locator("#standing").inner_text() and "1 of 2" in page.locator("#standing").inner_text()
    page.locator("#board tr.me").wait_for()
    attempts.get_by_role("link", name="Replay").first.click()
    page.wait_for_url(re.compile(r"/evaluations/\w+/replay/"))
    page.go_back()
    page.goto("/assignments/")
    assert "1 of 1" in page.locator("#tasks").inner_text()
    fits(page)


def _grade(page, student) -> None:
    """The table, the file, a regrade and a refund."""
    made = Assignment.objects.get()
    page.goto(f"/assignments/{made.public_id}/marks/")
    row = page.locator("#marks tbody tr", has_text="Kim Minji")
    assert "100" in row.inner_text() and "passed" in row.inner_text()
    fits(page)
    with page.expect_download() as download:
        page.get_by_role("link", name="Moodle").click()
    rows = list(csv.reader(io.StringIO(Path(download.value.path()).read_text("utf-8"), newline="")))
    assert rows == [["Student ID", "Full name", "Two laps"], ["20261", "Kim Minji", "100"]]
    page.goto(f"/assignments/{made.public_id}/parts/1/")
    page.get_by_label("Points", exact=True).fill("60")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("The marks stay as they are until you regrade.").wait_for()
    page.get_by_role("link", name="rules changed: regrade").click()
    page.get_by_label("Reason").fill("One part is enough")
    page.get_by_role("button", name="Show the new marks").click()
    page.locator("#regrade tr", has_text="Kim Minji").get_by_text("−40").wait_for()
    assert Mark.objects.get().points == 100, "nothing changes in silence"
    fits(page)
    page.get_by_role("button", name="Change 1 mark").click()
    page.get_by_text("Marks changed.").wait_for()
    assert Mark.objects.get().points == 60
    page.goto(Attempt.objects.get().get_absolute_url())
    page.get_by_label("Reason").fill("Wrong track in the instructions")
    page.get_by_role("button", name="Give it back").click()
    page.get_by_text("It counts for no limit and no mark.").wait_for()
    page.goto(f"/assignments/{made.public_id}/log/")
    log = page.locator("#log").inner_text()
    assert all(act in log for act in ("Assignment created", "Marks changed by a regrade", "Attempt given back"))
    fits(page)
    student.goto(made.get_absolute_url())
    student.get_by_text("Wrong track in the instructions").wait_for()
    assert "2 of 2" in student.locator("#standing").inner_text()
