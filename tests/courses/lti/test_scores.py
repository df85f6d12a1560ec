"""Marks to the grade book: when, once, in order, with the right token, and what becomes of refusals."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from decimal import Decimal
from pathlib import Path

import pytest
from django.test import Client

from accounts.models import Racer
from courses.lti.scores import SCORES, queue_scores, send_scores
from courses.models import Assignment, LtiAccount, LtiContext, LtiLine, LtiPlatform, LtiScore, Mark
from tests.clients import logged_in
from tests.courses.assignments import an_assignment
from tests.courses.lti.conftest import back_to, opened
from tests.courses.lti.launching import launched
from tests.courses.lti.platform import AGS, LINE, SCORE, Platform
from tests.factories import a_racer
from tests.kept import Kept

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="session")
def kept_student(
    request: pytest.FixtureRequest, keep: Callable, served: Platform, key_file: Path, now: datetime
) -> Kept:
    def arrive() -> None:
        linked(an_assignment(LtiContext.objects.get().group, now), served)
        launched(served, "s-1")

    return keep(request, lambda: opened(served, key_file, arrive), fresh_s=60.0)


def linked(assignment: Assignment, platform: Platform) -> Assignment:
    platform.link = {"assignment": assignment.public_id}
    platform.lines["1"] = {"id": f"{platform.base}/lines/1/line?of=7", "resourceId": assignment.public_id}
    return assignment


@pytest.fixture
def assignment(kept_student: Kept, db: None, platform: Platform) -> Assignment:
    """An assignment of the class, with a column in the grade book that the platform made with its link."""
    back_to(kept_student, platform)
    return linked(Assignment.objects.get(), platform)


@pytest.fixture
def course(assignment: Assignment) -> LtiContext:
    return LtiContext.objects.get()


@pytest.fixture
def ada(assignment: Assignment) -> Racer:
    """A student who came from the platform."""
    return LtiAccount.objects.get(sub="s-1").racer


def mark(assignment: Assignment, racer: Racer, points: int | str, now: datetime, **fields) -> Mark:
    """The racer's mark, as marks.services writes it."""
    values = {"points": Decimal(points), "is_complete": True, "computed_at": now, **fields}
    made, _new = Mark.objects.update_or_create(assignment=assignment, racer=racer, defaults=values)
    Assignment.objects.filter(pk=assignment.pk, final_at=None).update(final_at=now)
    return made


def sweep(now: datetime) -> int:
    """What the periodic task does."""
    queue_scores(now=now)
    return send_scores(worker="messenger")


def given(platform: Platform) -> list[tuple[str, float, float]]:
    return [(one["userId"], one["scoreGiven"], one["scoreMaximum"]) for one in platform.scores]


class TestSending:
    def test_a_mark_arrives(self, assignment, ada, platform, now):
        mark(assignment, ada, "87.5", now)
        assert sweep(now) == 1
        assert given(platform) == [("s-1", 87.5, 100.0)]
        assert platform.scores[0]["gradingProgress"] == "FullyGraded"
        assert LtiScore.objects.get().state == "sent"

    def test_a_mark_arrives_once(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        assert [sweep(now + timedelta(minutes=turn)) for turn in range(3)] == [1, 0, 0]
        assert len(platform.scores) == 1

    def test_a_changed_mark_arrives_with_a_later_time_stamp(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        sweep(now)
        mark(assignment, ada, 90, now + timedelta(minutes=1))
        sweep(now + timedelta(minutes=1))
        assert given(platform) == [("s-1", 80, 100), ("s-1", 90, 100)]
        assert platform.scores[0]["timestamp"] < platform.scores[1]["timestamp"]

    def test_only_the_newest_of_several_marks_is_sent(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        queue_scores(now=now)
        mark(assignment, ada, 70, now)
        sweep(now)
        assert given(platform) == [("s-1", 70, 100)]

    def test_an_incomplete_mark_waits(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now, is_complete=False)
        assert sweep(now) == 0
        mark(assignment, ada, 80, now + timedelta(minutes=1))
        assert sweep(now + timedelta(minutes=1)) == 1

    def test_a_zero_without_an_attempt_waits_until_the_marks_are_final(self, assignment, ada, platform, now):
        mark(assignment, ada, 0, now)
        Assignment.objects.update(final_at=None)
        assert sweep(now) == 0
        mark(assignment, ada, 0, now)
        LtiLine.objects.update(looked_at=None)
        assert sweep(now) == 1
        assert given(platform) == [("s-1", 0, 100)]

    def test_students_that_the_platform_does_not_know_are_left_out(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        mark(assignment, a_racer(), 70, now)
        assert sweep(now) == 1
        assert given(platform) == [("s-1", 80, 100)]

    def test_a_student_who_comes_after_the_mark(self, assignment, ada, platform, alice, now):
        mark(assignment, alice, 60, now - timedelta(days=1))
        assert sweep(now) == 0
        launched(platform, "s-2", client=logged_in(alice), do=("link",))
        assert sweep(now + timedelta(days=1)) == 1
        assert given(platform) == [("s-2", 60, 100)]

    def test_a_whole_class_takes_one_token(self, assignment, ada, platform, now):
        for number in range(3):
            platform.people[f"x-{number}"] = (f"Student {number}", "Learner")
            launched(platform, f"x-{number}")
            mark(assignment, LtiAccount.objects.get(sub=f"x-{number}").racer, 50 + number, now)
        assert sweep(now) == 3
        assert len(platform.tokens) == 1
        assert len(platform.scores) == 3

    def test_the_token_has_no_more_than_the_scope_for_scores(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        sweep(now)
        assert list(platform.tokens.values()) == [{SCORE}]
        assert platform.refused == []


class TestColumns:
    def test_a_missing_column_is_made_once(self, assignment, ada, platform, now):
        platform.lines.clear()
        LtiLine.objects.update(url="")
        mark(assignment, ada, 80, now)
        sweep(now)
        (line,) = platform.lines.values()
        assert (line["label"], line["scoreMaximum"], line["resourceId"]) == ("First", 100, assignment.public_id)
        assert LtiLine.objects.get().url == line["id"]
        assert given(platform) == [("s-1", 80, 100)]

    def test_a_column_that_is_there_is_found(self, assignment, ada, platform, now):
        LtiLine.objects.update(url="")
        mark(assignment, ada, 80, now)
        sweep(now)
        assert len(platform.lines) == 1
        assert given(platform) == [("s-1", 80, 100)]

    def test_without_the_scope_for_columns_the_teacher_reads_why(self, assignment, ada, platform, now):
        LtiLine.objects.update(url="")
        LtiContext.objects.update(scopes=[SCORE])
        mark(assignment, ada, 80, now)
        sweep(now)
        assert LtiScore.objects.get().reason_code == "lti_line"

    def test_a_launch_without_grade_services_makes_no_column(self, assignment, platform, course):
        LtiLine.objects.all().delete()  # Ada's launch has made it
        launched(platform, "s-2", **{f"{AGS}claim/endpoint": None})
        assert not LtiLine.objects.exists()


class TestRefusals:
    def test_a_platform_that_is_away_is_tried_again(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        platform.broken = 503
        sweep(now)
        score = LtiScore.objects.get()
        assert (score.state, score.attempt) == ("due", 1) or score.attempt > 1
        platform.broken = 0
        LtiScore.objects.update(not_before=None)
        sweep(now + timedelta(minutes=5))
        assert given(platform) == [("s-1", 80, 100)]

    def test_a_platform_that_is_away_is_asked_once_a_turn(self, assignment, ada, platform, now, monkeypatch):
        launched(platform, "s-2")
        mark(assignment, ada, 80, now)
        mark(assignment, LtiAccount.objects.get(sub="s-2").racer, 70, now)
        LtiPlatform.objects.update(token_url="http://127.0.0.1:9/token")
        asked = []
        ask = "courses.lti.asking.outgoing.ask"
        real = __import__("league.webhooks.outgoing_requests", fromlist=["ask"]).ask
        monkeypatch.setattr(ask, lambda *args, **options: asked.append(args) or real(*args, **options))
        sweep(now)
        assert len(asked) == 1
        assert {score.state for score in LtiScore.objects.all()} == {"due"}

    @pytest.mark.parametrize("status", [400, 403, 404, 422])
    def test_a_refusal_has_a_reason_and_ends_it(self, assignment, ada, platform, now, status):
        mark(assignment, ada, 80, now)
        platform.broken = status
        sweep(now)
        score = LtiScore.objects.get()
        assert (score.state, score.reason_code, score.reason_params) == ("failed", "lti_refused", {"status": status})
        assert sweep(now + timedelta(minutes=1)) == 0

    def test_an_unknown_key_gets_no_token(self, assignment, ada, platform, now, settings, tmp_path):
        mark(assignment, ada, 80, now)
        platform.tool_keys = lambda: {"keys": []}
        sweep(now)
        assert LtiScore.objects.get().reason_code == "lti_token_refused"
        assert platform.refused == ["token: unknown key"]

    def test_a_scope_that_the_platform_does_not_give(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        platform.scopes = (LINE,)
        sweep(now)
        assert LtiScore.objects.get().reason_code == "lti_token_refused"

    def test_no_score_goes_to_a_private_address(self, assignment, ada, platform, now, settings):
        mark(assignment, ada, 80, now)
        settings.LTI_PRIVATE = False
        sweep(now)
        assert LtiScore.objects.get().reason_code == "lti_address"
        assert platform.tokens == {}

    def test_a_score_that_arrived_before_its_sender_was_lost_is_not_an_error(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        sweep(now)
        SCORES.begin_anew(LtiScore.objects.all())  # as after a lost lease: the same mark, the same time stamp
        sweep(now)
        assert LtiScore.objects.get().state == "sent"
        assert len(platform.scores) == 1

    def test_a_newer_score_on_the_platform_stands(self, assignment, ada, platform, now):
        later = {"line": "1", "userId": "s-1", "timestamp": "2099-01-01T00:00:00+00:00", "scoreGiven": 1}
        platform.scores.append({**later, "scoreMaximum": 1})
        mark(assignment, ada, 80, now)
        sweep(now)
        assert LtiScore.objects.get().reason_params == {"status": 409}

    def test_a_platform_that_is_not_active_gets_nothing(self, assignment, ada, platform, now):
        mark(assignment, ada, 80, now)
        queue_scores(now=now)
        LtiPlatform.objects.update(is_active=False)
        assert sweep(now) == 0
        assert platform.tokens == {}


class TestTheTeachersPage:
    def failed(self, assignment, ada, platform, now) -> Client:
        mark(assignment, ada, 80, now)
        platform.broken = 404
        sweep(now)
        return launched(platform, "t-1")[0]

    def test_a_failure_is_shown_with_name_and_reason(self, assignment, ada, platform, course, now):
        page = self.failed(assignment, ada, platform, now).get(f"/classes/{course.group.slug}/lti/").content.decode()
        assert 'data-code="lti_refused"' in page
        assert "Ada Lovelace" in page

    def test_it_is_sent_again(self, assignment, ada, platform, course, now):
        client = self.failed(assignment, ada, platform, now)
        platform.broken = 0
        answer = client.post(f"/classes/{course.group.slug}/lti/", {"line": LtiLine.objects.get().pk})
        assert answer.status_code == 302
        sweep(now)
        assert given(platform) == [("s-1", 80, 100)]

    def test_a_line_of_another_class_is_not_sent_again(self, assignment, ada, platform, course, alice, now):
        self.failed(assignment, ada, platform, now)
        from accounts.class_accounts.services import make_class

        other = make_class(teacher=alice, name="Other", plan=(), now=now)
        sent = {"line": LtiLine.objects.get().pk}
        assert logged_in(alice).post(f"/classes/{other.group.slug}/lti/", sent).status_code == 404
        assert LtiScore.objects.get().state == "failed"
