"""Assignments by the API: a teacher's and a student's way through, and refusals."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from courses.models import Assignment, Attempt
from tests.clients import logged_in
from tests.courses.assignments import a_group, an_assignment, finish_all, hand_in
from tests.factories import a_model, a_track, laps

pytestmark = pytest.mark.django_db

LIST = "/api/v1/assignments/"
PART = {
    "title": "Laps",
    "points": "60.50",
    "pass_rule": "laps_in_row",
    "pass_params": {"laps": 3},
    "rules": {"laps": 5},
}


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def send(client, method: str, address: str, body: dict | None = None, **options):
    return getattr(client, method)(address, body or {}, content_type="application/json", **options)


@pytest.fixture
def body() -> dict:
    a_track()
    now = timezone.now()
    times = {"opens_at": now - timedelta(hours=1), "due_at": now + timedelta(days=1)}
    parts = [PART | {"tracks": [{"track": "oval"}]}]
    return {"group": "course", "title": "First", "parts": parts, **{name: at.isoformat() for name, at in times.items()}}


def test_a_teacher_makes_and_a_student_hands_in(alice, now, body):
    _group, (bob,) = a_group(alice, 1, now)
    teacher, student = logged_in(alice), logged_in(bob)
    made = send(teacher, "post", LIST, body)
    assert made.status_code == 201, made.content
    below = f"{LIST}{made.json()['public_id']}/"
    assert (made.json()["parts"][0]["points"], made.json()["published_at"]) == ("60.50", None)
    assert made.json()["parts"][0]["sentence"] == "3 complete laps in a row on each track."
    assert (student.get(below).status_code, student.get(LIST).json()["count"]) == (404, 0)
    assert send(teacher, "post", f"{below}publication/").json()["published_at"] is not None
    assert student.get(LIST).json()["count"] == 1
    handed = send(student, "post", f"{below}attempts/", {"model": a_model(bob).public_id})
    assert (handed.status_code, [run["state"] for run in handed.json()["runs"]]) == (201, ["waiting"])
    finish_all(Attempt.objects.get(), laps(9_000, 9_000, 9_000), timezone.now())
    (mark,) = student.get(f"{below}marks/").json()["results"]
    assert (mark["points"], mark["is_complete"], mark["parts"][0]["why"]) == ("60.50", True, "passed")
    assert teacher.get(f"{below}marks/").json()["count"] == 1


def test_a_repeated_request_hands_in_once(alice, now, body):
    _group, (bob,) = a_group(alice, 1, now)
    below = f"{LIST}{send(logged_in(alice), 'post', LIST, body).json()['public_id']}/"
    send(logged_in(alice), "post", f"{below}publication/")
    sent, key = {"model": a_model(bob).public_id}, {"HTTP_IDEMPOTENCY_KEY": "once"}
    first, again = (send(logged_in(bob), "post", f"{below}attempts/", sent, **key) for _time in range(2))
    assert (first.json(), first.status_code) == (again.json(), again.status_code) and Attempt.objects.count() == 1
    refused = send(logged_in(bob), "post", f"{below}attempts/", sent)
    assert (refused.status_code, refused.json()["code"]) == (409, "attempt_already_submitted")


@pytest.mark.parametrize(
    "change, field",
    [
        ({"due_at": "2020-01-01T00:00:00Z"}, "due_at"),
        ({"time_zone": "Mars/Base"}, "time_zone"),
        ({"counts": "first_k"}, "first_k"),
        ({"parts": [PART | {"tracks": [{"track": "oval"}], "pass_params": {"laps": "x"}}]}, "parts"),
        ({"parts": [PART | {"tracks": [{"track": "oval"}], "rules": {"boxes": 3}}]}, "parts"),
        ({"parts": [{"tracks": [{"track": "oval"}]}]}, "parts"),
        ({"parts": [PART | {"tracks": [{"track": "nowhere"}]}]}, "parts"),
    ],
)
@pytest.mark.parametrize("method", ["post", "patch"])
def test_each_problem_is_named_by_its_field(alice, now, body, method, change, field):
    group, _students = a_group(alice, 0, now)
    address = LIST if method == "post" else f"{LIST}{an_assignment(group, timezone.now()).public_id}/"
    refused = send(logged_in(alice), method, address, body | change if method == "post" else change)
    assert refused.status_code == 400, refused.content
    assert {name.partition(".")[0] for name in refused.json()["fields"]} == {field}
    assert Assignment.objects.count() == (method == "patch")


def test_students_cannot_do_what_teachers_do(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now)
    attempt = hand_in(assignment, bob, now)
    below = f"{LIST}{assignment.public_id}/"
    client = logged_in(carol)
    assert client.get(f"/api/v1/attempts/{attempt.public_id}/").status_code == 404
    assert client.get(f"{below}attempts/").json()["count"] == 0
    for address in ("extensions", "groups", "references", "regrades"):
        assert client.get(f"{below}{address}/").status_code == 403
    refused = send(client, "post", f"{below}extensions/", {"racer": carol.alias, "due_at": "2099-01-01T00:00:00Z"})
    assert (refused.status_code, refused.json()["code"]) == (403, "assignment_not_yours")
