"""The pages of assignments: what teachers and students see and do there."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.cache import cache

from accounts.class_accounts.services import add_learners, make_class
from courses.assignments.services import make_submission_group
from courses.attempts.draws import draw_hidden_tracks
from courses.attempts.pages import board_of
from courses.attempts.services import add_reference
from courses.grading.members import unit_of
from courses.models import Assignment, Attempt
from tests.clients import logged_in
from tests.courses.assignments import DAY, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_model, a_racer, a_track, lap, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _fresh(wakes) -> None:
    cache.clear()


@pytest.fixture
def group(alice, now):
    return a_group(alice, 2, now)


def text(client, path: str, status: int = 200) -> str:
    answer = client.get(path)
    assert answer.status_code == status, path
    return answer.content.decode()


PAGES = ("", "edit/", "parts/1/", "exceptions/", "marks/", "regrade/", "log/")


def test_a_teacher_reads_every_page(group, alice, now):
    made = an_assignment(group[0], now)
    client = logged_in(alice)
    for page in PAGES:
        assert "First" in text(client, f"/assignments/{made.public_id}/{page}")
    assert "First" in text(client, "/assignments/")


def test_a_student_sees_what_is_due_passed_and_left(group, alice, now, set_clock):
    set_clock(now)
    room, (kim, _ann) = group
    made = an_assignment(room, now, attempts_in_all=3, attempts_a_day=2, time_zone="Europe/Berlin")
    client = logged_in(kim)
    page = text(client, "/assignments/")
    assert "First" in page and "in 24 hours · Mon 16 Nov, 13:00 Berlin" in page
    assert "3 of 3" in page and "today 2 of 2" in page and "0 of 1" in page
    attempt = hand_in(made, kim, now)
    finish_all(attempt, laps(*[9_000] * 5), now)
    page = text(client, "/assignments/")
    assert "2 of 3" in page and "today 1 of 2" in page and "1 of 1" in page and "100" in page
    page = text(client, made.get_absolute_url())
    assert "5 laps in a row" in page and "/replay/" in page and "Attempt 1" in page


def test_a_run_of_an_attempt_leads_back_to_it(group, alice, now):
    room, (kim, _ann) = group
    made = an_assignment(room, now)
    attempt = hand_in(made, kim, now)
    finish_all(attempt, laps(*[9_000] * 5), now)
    run = attempt.runs.get().evaluation
    for reader in (kim, alice):
        for path in (run.get_absolute_url(), f"{run.get_absolute_url()}replay/"):
            page = text(logged_in(reader), path)
            assert f'href="{made.get_absolute_url()}">First' in page and f'href="{attempt.get_absolute_url()}"' in page


def test_the_board_ranks_groups_once_and_reference_rows_never(alice, now):
    room, (kim, ann, bo) = a_group(alice, 3, now)
    made = an_assignment(room, now, shows="named")
    make_submission_group(assignment=made, by=alice, name="Pair", racers=[kim, ann], now=now)
    finish_all(hand_in(made, kim, now), laps(*[9_000] * 5), now)
    finish_all(hand_in(made, bo, now), laps(*[9_000] * 5), now)
    reference = add_reference(assignment=made, by=alice, label="Assistants", model=a_model(alice), now=now)
    finish_all(reference.attempt, laps(9_000), now)
    shown = [(line.place, line.name, line.is_me) for line in board_of(made, unit_of(made, ann))]
    assert shown == [(1, "Pair", True), (1, bo.shown_name, False), (None, "Assistants", False)]
    page = text(logged_in(ann), made.get_absolute_url())
    assert "not ranked" in page and "You submit together:" in page and kim.alias in page


def test_each_number_of_a_late_mark_stands_in_the_open(group, alice, now, set_clock):
    room, (kim, _ann) = group
    parts = [
        a_part(title="Fast", points=60, pass_rule="best_lap", pass_params={"at_most_ms": 9_500}),
        a_part(points=40),
    ]
    made = an_assignment(room, now, last_at=now + 9 * DAY, late_points_a_day=20, parts=parts)
    later = now + 2 * DAY + timedelta(hours=1)
    attempt = hand_in(made, kim, later)
    finish_all(attempt, [*laps(9_600, 9_700), lap(3, complete=False), *laps(9_800)], later)
    set_clock(later)
    page = " ".join(text(logged_in(kim), made.get_absolute_url()).split())
    assert "0:09.600, at most 0:09.500 needed." in page and "2 days late" in page
    set_clock(now + DAY + timedelta(hours=1))
    finish_all(hand_in(made, kim, now + DAY + timedelta(hours=1)), laps(*[9_400] * 5), later)
    page = " ".join(text(logged_in(kim), attempt.assignment.get_absolute_url()).split())
    assert "1 late day at 20 points" in page and "−20" in page and "80 / 100" in page


@pytest.mark.parametrize("page", ["", "marks/", "marks.csv", "log/"])
def test_a_candidate_is_shown_to_no_student_before_its_time(group, alice, now, set_clock, page):
    room, (kim, _ann) = group
    hidden = track_row("h-track")
    part = a_part(tracks=[(a_track(), "shown"), (hidden, "candidate")], hidden_tracks=1)
    made = an_assignment(room, now, parts=[part])
    attempt = hand_in(made, kim, now)
    set_clock(now)
    student, teacher = logged_in(kim), logged_in(alice)
    for path in (f"/assignments/{made.public_id}/{page}", attempt.get_absolute_url(), "/assignments/", "/"):
        assert (
            hidden.name not in student.get(path).content.decode()
            and "h-track" not in student.get(path).content.decode()
        )
    assert "+ 1 hidden track" in text(student, made.get_absolute_url())
    assert hidden.name in text(teacher, f"/assignments/{made.public_id}/parts/1/")
    draw_hidden_tracks(now=now + 2 * DAY)
    assert hidden.name in text(student, made.get_absolute_url())


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"opens_at": "+1"}, "It has not opened yet."),
        ({"due_at": "-1"}, "The deadline has passed."),
        ({"attempts_in_all": 1}, "You have used all attempts."),
        ({"attempts_a_day": 1}, "You have used all attempts of today."),
    ],
)
def test_the_form_to_hand_in_says_why_it_is_not_there(group, now, set_clock, fields, sentence):
    room, (kim, _ann) = group
    made = an_assignment(room, now)
    hand_in(made, kim, now)
    moved = {
        name: now + int(value) * timedelta(hours=1) if isinstance(value, str) else value
        for name, value in fields.items()
    }
    Assignment.objects.filter(pk=made.pk).update(**{"opens_at": now - 3 * DAY} | moved)
    set_clock(now)
    a_model(kim)
    page = text(logged_in(kim), made.get_absolute_url())
    assert sentence in page and 'id="send-model"' not in page


def test_a_refusal_of_the_service_is_said_on_the_page(group, now, set_clock):
    room, (kim, ann) = group
    made = an_assignment(room, now)
    set_clock(now)
    client, theirs = logged_in(kim), a_model(ann)
    for sent in ({}, {"model": theirs.public_id}):
        answer = client.post(made.get_absolute_url(), sent)
        assert answer["Location"].endswith("#send")
    assert not Attempt.objects.exists()
    model = a_model(kim)
    assert client.post(made.get_absolute_url(), {"model": model.public_id})["Location"].endswith("#attempts")
    client.post(made.get_absolute_url(), {"model": model.public_id})
    assert Attempt.objects.count() == 1 and "This car is the latest attempt already" in text(
        client, made.get_absolute_url()
    )


def test_the_table_of_marks_is_sorted_by_its_columns(alice, now):
    room, (kim, ann, bo) = a_group(alice, 3, now)
    made = an_assignment(room, now)
    finish_all(hand_in(made, ann, now), laps(*[9_000] * 5), now)
    finish_all(hand_in(made, bo, now), laps(9_000), now)
    hand_in(made, bo, now)

    def order(sort: str) -> list[str]:
        page = text(logged_in(alice), f"/assignments/{made.public_id}/marks/?sort={sort}").partition("<tbody>")[2]
        return sorted((one.alias for one in (kim, ann, bo)), key=page.index)

    assert order("name") == sorted(one.alias for one in (kim, ann, bo))
    assert order("points")[0] == ann.alias and order("-points")[-1] == ann.alias
    assert order("attempts")[0] == bo.alias and order("nonsense") == order("name")


def test_the_first_page_and_the_card_s_page_show_what_is_due(alice, now, set_clock):
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    (card,) = add_learners(classroom=room, by=alice, names=["Kim Minji"], now=now)
    made = an_assignment(room.group, now)
    an_assignment(room.group, now, publish=False, title="Draft")
    set_clock(now)
    client = logged_in(card.learner.racer)
    for path in ("/", "/class/", room.group.get_absolute_url()):
        page = text(client, path)
        assert made.get_absolute_url() in page and "Draft" not in page, path
    assert made.get_absolute_url() not in text(logged_in(a_racer()), "/")
