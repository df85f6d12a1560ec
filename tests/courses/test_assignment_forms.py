"""The forms of assignments: what they refuse, with sentences that say what to do, and what they store."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest
from django.core.cache import cache

from courses.models import Assignment, AssignmentPart, PartTrack, TrackKind
from tests.clients import logged_in
from tests.courses.assignments import a_group, an_assignment, hand_in
from tests.factories import a_track
from tests.rows import track_row

pytestmark = pytest.mark.django_db
FORM = {
    "title": "Three laps",
    "time_zone": "Europe/Berlin",
    "opens_at": "2026-11-16T08:00",
    "due_at": "2026-11-29T23:59",
    "counts": "best",
    "shows": "own",
}
PART = {
    **{"title": "Laps", "points": "60", "pass_rule": "laps_in_row", "laps_in_row_laps": "3", "race_type": "time_trial"},
    **{"track": "oval", "direction": "ccw", "laps": "5", "off_track_penalty_ms": "2", "max_simulated_ms": "180"},
}


@pytest.fixture(autouse=True)
def _fresh(wakes) -> None:
    cache.clear()
    a_track()


@pytest.fixture
def group(alice, now):
    return a_group(alice, 2, now)


def errors(client, path: str, sent: dict[str, Any]) -> str:
    answer = client.post(path, sent)
    assert answer.status_code == 422, answer.status_code
    return answer.content.decode()


def test_a_draft_is_made_in_its_time_zone(group, alice):
    sent = {"group": group[0].slug, **FORM, "attempts_in_all": "5", "late_points_a_day": "20", "once": "a"}
    answer = logged_in(alice).post("/assignments/new/", sent)
    made = Assignment.objects.get()
    assert answer["Location"] == f"/assignments/{made.public_id}/parts/new/"
    assert made.due_at == datetime(2026, 11, 29, 22, 59, tzinfo=UTC) and made.published_at is None
    assert (made.attempts_in_all, made.attempts_a_day, str(made.late_points_a_day)) == (5, None, "20.00")
    logged_in(alice).post("/assignments/new/", sent)
    assert Assignment.objects.count() == 1, "the same form a second time"


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        ({"title": " "}, "This field is required."),
        ({"due_at": "2026-11-16T08:00"}, "The deadline is not after the opening. Choose a later one."),
        ({"last_at": "2026-11-29T23:00"}, "The last moment for late attempts is not after the deadline."),
        ({"due_at": "2027-03-28T02:30"}, "The clocks go forward then: this time does not exist. Choose another."),
        ({"due_at": "tomorrow"}, "Enter a valid date/time."),
        ({"time_zone": "Mars/Olympus"}, "Select a valid choice."),
        ({"counts": "first_k"}, "Say how many of the first attempts count."),
        ({"attempts_a_day": "0"}, "greater than or equal to 1"),
        ({"late_points_a_day": "-5"}, "greater than or equal to 0"),
        ({"group": "no-such"}, "Select a valid choice."),
    ],
)
def test_a_wrong_value_is_named_and_nothing_is_made(group, alice, sent, sentence):
    page = errors(logged_in(alice), "/assignments/new/", {"group": group[0].slug, **FORM, **sent, "once": "a"})
    assert sentence in page and "Not saved." in page and not Assignment.objects.exists()


def test_the_hour_that_comes_twice_is_the_earlier_one_and_says_so(group, alice, set_clock, now):
    logged_in(alice).post(
        "/assignments/new/", {"group": group[0].slug, **FORM, "due_at": "2027-10-31T02:30", "once": "a"}
    )
    made = Assignment.objects.get()
    assert made.due_at == datetime(2027, 10, 31, 0, 30, tzinfo=UTC)
    set_clock(now)
    page = logged_in(alice).get(made.get_absolute_url()).content.decode()
    assert "Sun 31 Oct 2027, 02:30 Berlin (CEST)" in page


def test_saving_an_untouched_form_keeps_the_seconds(group, alice, now):
    made = an_assignment(
        group[0], now, due_at=datetime(2026, 11, 29, 22, 59, 59, tzinfo=UTC), time_zone="Europe/Berlin"
    )
    page = logged_in(alice).get(f"/assignments/{made.public_id}/edit/").content.decode()
    assert "2026-11-29T23:59" in page
    sent = {**FORM, "opens_at": "2026-11-15T12:00", "title": "Renamed"}
    assert logged_in(alice).post(f"/assignments/{made.public_id}/edit/", sent).status_code == 302
    made.refresh_from_db()
    assert made.title == "Renamed" and made.due_at.second == 59


def a_draft(group, now) -> Assignment:
    return an_assignment(group[0], now, publish=False, parts=[])


def test_a_part_with_several_and_hidden_tracks_is_added(group, alice, now):
    track_row("bowtie-track")
    track_row("h-track")
    made = a_draft(group, now)
    sent = {**PART, "more_tracks": ["bowtie-track"], "candidates": ["h-track"], "hidden_tracks": "1", "once": "b"}
    answer = logged_in(alice).post(f"/assignments/{made.public_id}/parts/new/", sent)
    assert answer.status_code == 302
    part = AssignmentPart.objects.get()
    assert part.pass_params == {"laps": 3, "clean": False} and part.race_rules.laps == 5 and str(part.points) == "60.00"
    kinds = dict(PartTrack.objects.values_list("track__slug", "kind"))
    assert kinds == {"oval": TrackKind.SHOWN, "bowtie-track": TrackKind.SHOWN, "h-track": TrackKind.CANDIDATE}


def test_a_form_that_is_sent_as_it_stands_changes_no_rule(group, alice, now):
    """Its fields hold exactly the stored rules, so that a driven part can be saved, too."""
    rules = {"race_type": "object_avoidance", "laps": 4, "random_boxes": 3, "seed": 7, "max_resets": 2}
    part = {
        "title": "Boxes",
        "points": 40,
        "pass_rule": "average_lap",
        "pass_params": {"laps": 2, "at_most_ms": 12_500},
    }
    made = an_assignment(group[0], now, parts=[{**part, "rules": rules, "tracks": [(a_track(), "shown")]}])
    hand_in(made, group[1][0], now)
    before = AssignmentPart.objects.get()
    path = f"/assignments/{made.public_id}/parts/1/"
    page = logged_in(alice).get(path).content.decode()
    assert "Students have handed in" in page and 'value="12.5"' in page
    sent = {"title": "Boxes", "points": "30", "pass_rule": "average_lap"}
    sent |= {"average_lap_laps": "2", "average_lap_at_most_ms": "12.5", "do": "save"}
    assert logged_in(alice).post(path, sent).status_code == 302
    after = AssignmentPart.objects.get()
    assert after.rules == before.rules and after.pass_params == before.pass_params and after.points == 30


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        ({"title": ""}, "This field is required."),
        ({"points": "0"}, "greater than or equal to 0.01"),
        ({"pass_rule": "magic"}, "Select a valid choice."),
        ({"laps_in_row_laps": ""}, "Enter a value."),
        ({"laps_in_row_laps": "8"}, "The rule needs 8 laps, but only 5 are driven. Raise the laps driven."),
        ({"track": ""}, "This field is required."),
        ({"candidates": ["oval"], "hidden_tracks": "1"}, "Shown already, so it cannot be hidden: Paddock Oval."),
        ({"hidden_tracks": "2"}, "Tick at least as many candidates as tracks are drawn."),
        ({"race_type": "object_avoidance", "box_choice": "fixed"}, "box"),
        ({"race_type": "head_to_head", "opponents": "models"}, "Select a valid choice."),
        (
            {"pass_rule": "thresholds", "thresholds_by": "best", "thresholds_thresholds": "fast"},
            "Line 1: write seconds",
        ),
        (
            {"pass_rule": "thresholds", "thresholds_by": "best", "thresholds_thresholds": "9: 70"},
            "more points than the part",
        ),
        ({"pass_rule": "thresholds", "thresholds_by": "best", "thresholds_thresholds": ""}, "Enter a value."),
        ({"pass_rule": "best_lap", "best_lap_at_most_ms": "0"}, "greater than or equal to"),
    ],
)
def test_a_wrong_part_is_refused_beside_its_field(group, alice, now, sent, sentence):
    made = a_draft(group, now)
    page = errors(logged_in(alice), f"/assignments/{made.public_id}/parts/new/", {**PART, **sent, "once": "c"})
    assert sentence in page and not AssignmentPart.objects.exists()


def test_thresholds_are_lines_the_fastest_first(group, alice, now):
    made = a_draft(group, now)
    sent = {
        **PART,
        "pass_rule": "thresholds",
        "thresholds_by": "best",
        "thresholds_thresholds": "15: 20\n12.5:60\n",
        "once": "d",
    }
    assert logged_in(alice).post(f"/assignments/{made.public_id}/parts/new/", sent).status_code == 302
    stored = AssignmentPart.objects.get().pass_params["thresholds"]
    assert stored == [{"at_most_ms": 12_500, "points": "60"}, {"at_most_ms": 15_000, "points": "20"}]
    assert "12.5: 60\n15: 20" in logged_in(alice).get(f"/assignments/{made.public_id}/parts/1/").content.decode()


def test_a_draft_without_parts_is_not_published(group, alice, now):
    made = a_draft(group, now)
    page = logged_in(alice).post(f"/assignments/{made.public_id}/publish/", follow=True).content.decode()
    made.refresh_from_db()
    assert "The assignment has no parts. Add one." in page and made.published_at is None


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        ({"do": "extend", "due_at": "2026-11-15T09:00", "reason": "Ill"}, "The extension is not after the deadline."),
        ({"do": "extend", "due_at": "2026-12-15T09:00", "reason": ""}, "This field is required."),
        ({"do": "extend", "due_at": "2026-12-15T09:00", "reason": "Ill", "racer": "nobody"}, "Select a valid choice."),
        ({"do": "group", "name": "Pair"}, "This field is required."),
        ({"do": "reference", "label": "TA", "model": "nothing"}, "Select a valid choice."),
    ],
)
def test_a_wrong_exception_is_refused(group, alice, now, sent, sentence):
    made = an_assignment(group[0], now)
    sent = {"racer": group[1][0].alias, **sent}
    assert sentence in errors(logged_in(alice), f"/assignments/{made.public_id}/exceptions/", sent)


def test_a_student_in_two_groups_is_refused(group, alice, now):
    made = an_assignment(group[0], now)
    path, (kim, ann) = f"/assignments/{made.public_id}/exceptions/", group[1]
    pair = {"do": "group", "name": "Pair", "racers": [kim.alias, ann.alias]}
    assert logged_in(alice).post(path, pair).status_code == 302
    page = errors(logged_in(alice), path, pair | {"name": "Other", "racers": [ann.alias]})
    assert "A student is in another submission group of the assignment. Nothing was changed." in page
