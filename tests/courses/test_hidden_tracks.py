"""Hidden tracks: drawn at the deadline, the same by the same secret, and known to nobody but teachers before."""

from __future__ import annotations

import io
import json
import zipfile
from datetime import timedelta

import pytest
from django.urls import reverse

from core.events import Event
from core.personal_data.exporting import archive
from courses.assignments.services import change_assignment, extend
from courses.attempts import draws
from courses.attempts.draws import draw_hidden_tracks, drawn_of
from courses.attempts.services import refund_attempt
from courses.models import Assignment, AttemptRun, Mark, PartTrack, TrackKind
from evaluation.models import Evaluation
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from races.entries.selectors.visibility import can_see_evaluation, evaluations_visible_to
from races.errors import RaceRefused
from tests.clients import logged_in
from tests.courses.assignments import DAY, HOUR, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_model, a_racer, a_track, laps
from tests.rows import track_row
from tracks.models import Track

pytestmark = pytest.mark.django_db

CANDIDATES = [track.slug for track in CATALOGUE if not track.is_open and track.slug != "oval"][:3]
FAST = laps(9000, 9000, 9000, 9000, 9000)


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def test_a_candidate_is_from_the_catalogue_or_a_teachers_own(alice, now):
    """The importer of a track can try to delete it, and would learn that something uses it."""
    group, (bob,) = a_group(alice, 1, now)
    imported = track_row(CANDIDATES[0])
    parts = [a_part(tracks=[(a_track(), "shown"), (imported, "candidate")], hidden_tracks=1)]
    for owner, is_refused in ((bob, True), (a_racer(), True), (alice, False)):
        Track.objects.filter(pk=imported.pk).update(owner=owner, is_catalogue=False)
        imported.refresh_from_db()
        if not is_refused:
            assert an_assignment(group, now, parts=parts).parts.count() == 1
            continue
        with pytest.raises(RaceRefused) as refused:
            an_assignment(group, now, parts=parts)
        (error,) = refused.value.errors.error_dict["parts"]
        assert error.code == "assignment_candidate_imported"
    assert an_assignment(group, now, parts=[a_part(tracks=[(imported, "shown")])]).parts.count() == 1


def hidden(now, **fields) -> dict:
    """The fields of an assignment on the oval, with one of three candidates hidden."""
    tracks = [(Track.objects.filter(slug=slug).first() or track_row(slug), "candidate") for slug in CANDIDATES]
    return {"parts": [a_part(tracks=[(a_track(), "shown"), *tracks], hidden_tracks=1)], **fields}


@pytest.fixture
def world(alice, now):
    group, students = a_group(alice, 3, now)
    return an_assignment(group, now, last_at=now + 9 * DAY, **hidden(now)), students


def drawn(assignment: Assignment) -> list[Track]:
    return [one.track for one in PartTrack.objects.filter(part__assignment=assignment, kind=TrackKind.DRAWN)]


def names_in(text: str, assignment: Assignment, *, but: list[Track] = ()) -> list[str]:
    """Which candidates a text names."""
    rows = PartTrack.objects.filter(part__assignment=assignment).exclude(kind=TrackKind.SHOWN).select_related("track")
    rows = rows.exclude(track__in=but)
    return [name for one in rows for name in (one.track.slug, one.track.name) if name in text]


def read_by_a_student(assignment: Assignment, racer, now) -> str:
    """All that a student can ask of the site about an assignment, one after the other."""
    client, texts = logged_in(racer), []
    below = f"/api/v1/assignments/{assignment.public_id}"
    attempts = client.get(f"{below}/attempts/").json()["results"]
    addresses = ["/api/v1/assignments/", f"{below}/", f"{below}/attempts/", f"{below}/marks/", "/api/v1/evaluations/"]
    addresses += [f"/api/v1/attempts/{one['public_id']}/" for one in attempts]
    addresses += [f"/api/v1/evaluations/{one['evaluation']}/" for each in attempts for one in each["runs"]]
    addresses += [f"{below}/{name}/" for name in ("extensions", "groups", "references", "regrades")]
    addresses += [reverse("own_runs"), "/notices/", "/", reverse("assignments")]
    addresses += [reverse("assignment", args=[assignment.public_id])]
    addresses += [reverse("attempt", args=[one["public_id"]]) for one in attempts]
    addresses += [reverse("evaluation", args=[one["evaluation"]]) for each in attempts for one in each["runs"]]
    of_teachers = ("edit", "students", "marks", "marks_csv", "regrade", "log")
    addresses += [reverse(f"assignment_{name}", args=[assignment.public_id]) for name in of_teachers]
    texts += [client.get(address).content.decode() for address in addresses]
    sent = [
        client.patch(f"{below}/", {"parts": [], "title": "x"}, content_type="application/json"),
        client.post(f"{below}/attempts/", {"model": "nonsense"}, content_type="application/json"),
        client.post(f"{below}/attempts/", {"model": a_model(racer).public_id}, content_type="application/json"),
    ]
    assert [answer.status_code for answer in sent][:2] == [403, 404]
    texts += [answer.content.decode() for answer in sent]
    texts += [json.dumps([event.subject, event.data]) for event in Event.objects.all()]
    packed = zipfile.ZipFile(io.BytesIO(b"".join(archive(racer, now=now))))
    texts += [packed.read(name).decode(errors="replace") for name in packed.namelist()]
    return "\n".join(texts)


def test_nothing_names_a_hidden_track_before_the_deadline(world, now):
    assignment, (bob, *_others) = world
    finish_all(hand_in(assignment, bob, now), FAST, now)
    assert draw_hidden_tracks(now=assignment.due_at) == 0
    read = read_by_a_student(assignment, bob, now)
    assert len(read) > 5000 and "oval" in read
    assert names_in(read, assignment) == []
    assert {one.track.slug for one in Evaluation.objects.select_related("track")} == {"oval"}
    mark = Mark.objects.get(racer=bob)
    assert (mark.points, mark.is_complete, mark.parts[0]["why"]) == (0, False, "hidden_waits")


def test_only_drawn_tracks_are_revealed(world, now):
    assignment, (bob, *_others) = world
    finish_all(hand_in(assignment, bob, now), FAST, now)
    after = assignment.due_at + timedelta(seconds=1)
    assert draw_hidden_tracks(now=after) == 1
    read = read_by_a_student(Assignment.objects.get(), bob, after)
    assert names_in(read, assignment, but=drawn(assignment)) == []
    assert drawn(assignment)[0].slug in read


def test_teachers_see_candidates_and_no_student_does(world, alice):
    assignment, (bob, *_others) = world
    address = f"/api/v1/assignments/{assignment.public_id}/"
    assert len(names_in(logged_in(alice).get(address).content.decode(), assignment)) >= 3
    part = logged_in(bob).get(address).json()["parts"][0]
    assert part["tracks"] == [{"track": "oval", "kind": "shown"}] and part["hidden_tracks"] == 1
    for viewer in (alice, bob):
        assert assignment.draw_seed not in logged_in(viewer).get(address).content.decode()


def test_the_draw_waits_for_the_deadline_and_happens_once(world, now):
    assignment, (bob, *_others) = world
    hand_in(assignment, bob, now)
    assert draw_hidden_tracks(now=assignment.due_at) == 0
    after = assignment.due_at + timedelta(microseconds=1)
    assert (draw_hidden_tracks(now=after), draw_hidden_tracks(now=after)) == (1, 0)
    assert len(drawn(assignment)) == 1 and AttemptRun.objects.count() == 2


def test_the_secret_alone_decides_the_draw(world):
    assignment, _students = world
    part = assignment.parts.get()
    assert drawn_of(assignment, part) == drawn_of(Assignment.objects.get(), part)
    by_seed = set()
    for number in range(40):
        assignment.draw_seed = f"{number:032x}"
        by_seed.update(drawn_of(assignment, part))
    assert len(by_seed) == 3


def test_a_late_attempt_drives_the_drawn_track_at_once(world, now):
    assignment, (bob, *_others) = world
    after = assignment.due_at + HOUR
    attempt_before_the_draw = hand_in(assignment, bob, after)
    assert attempt_before_the_draw.runs.count() == 1
    draw_hidden_tracks(now=after)
    assert attempt_before_the_draw.runs.count() == 2
    assert hand_in(assignment, bob, after + HOUR).runs.count() == 2


def test_an_extended_attempt_drives_the_drawn_track_at_once(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, **hidden(now))
    late = assignment.due_at + HOUR
    extend(assignment=assignment, racer=bob, by=alice, due_at=late, last_at=None, reason="ill", now=now)
    draw_hidden_tracks(now=assignment.due_at + timedelta(seconds=9))
    attempt = hand_in(assignment, bob, late)
    finish_all(attempt, FAST, late)
    assert attempt.runs.count() == 2
    mark = Mark.objects.get(racer=bob)
    assert (mark.points, mark.late_days, mark.is_complete) == (100, 0, True)


def test_attempts_that_cannot_count_do_not_drive_hidden_tracks(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, counts="last", **hidden(now))
    first, second = hand_in(assignment, bob, now), hand_in(assignment, bob, now + HOUR)
    after = assignment.due_at + HOUR
    draw_hidden_tracks(now=after)
    assert [one.runs.count() for one in (first, second)] == [1, 2]
    refund_attempt(attempt=second, by=alice, reason="a broken track", now=after)
    assert first.runs.count() == 2, "the one before counts now"


def test_a_draw_that_fails_half_way_is_done_whole_the_next_time(world, now, monkeypatch):
    assignment, (bob, *_others) = world
    hand_in(assignment, bob, now)
    after = assignment.due_at + HOUR

    def killed(*arguments):
        raise SystemExit

    with monkeypatch.context() as patch:
        patch.setattr(draws, "queue_hidden_runs", killed)
        with pytest.raises(SystemExit):
            draw_hidden_tracks(now=after)
    assert drawn(assignment) == [] and Assignment.objects.get().drawn_at is None
    assert draw_hidden_tracks(now=after) == 1 and AttemptRun.objects.count() == 2


def test_a_drawn_assignment_keeps_its_deadline_and_tracks(world, alice, now):
    assignment, _students = world
    after = assignment.due_at + HOUR
    draw_hidden_tracks(now=after)
    for fields in ({"due_at": after + DAY, "last_at": None}, {"parts": [a_part()]}):
        with pytest.raises(UserFault) as refused:
            change_assignment(assignment=assignment, by=alice, now=after, **fields)
        assert refused.value.code in ("assignment_drawn", "assignment_has_begun")


def test_runs_of_attempts_are_seen_by_their_student_and_the_teachers(world, alice, now, bob):
    assignment, (carol, dave, _erin) = world
    run = hand_in(assignment, carol, now).runs.get().evaluation
    seen = {racer.alias: can_see_evaluation(racer, run) for racer in (alice, carol, dave, bob)}
    assert seen == {"alice": True, carol.alias: True, dave.alias: False, "bob": False}
    for racer in (alice, carol, dave, bob):
        assert evaluations_visible_to(racer).filter(pk=run.pk).exists() == can_see_evaluation(racer, run)
    assert not can_see_evaluation(None, run)
