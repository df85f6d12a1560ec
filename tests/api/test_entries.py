"""Getting into a race, sending cars, getting out, through the API."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from paddock.errors import PlatformFault, UserFault
from races.models import Submission
from tests.factories import a_model, a_race, drive, fail, finish, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def race(now, alice):
    return a_race(now, organiser=alice, max_submissions=2)


def address(race, part="") -> str:
    return f"/api/v1/races/{race.slug}/{part}"


def test_entering_twice_makes_one_entry(bob, race, as_racer):
    client = as_racer(bob)
    missing = client.get(address(race, "entry/"))
    assert (missing.status_code, missing.data["code"]) == (404, "entry_missing")
    first, second = client.post(address(race, "entry/")), client.post(address(race, "entry/"))
    assert first.status_code == second.status_code == 200
    assert first.data == second.data == client.get(address(race, "entry/")).data
    assert (first.data["racer"], first.data["submissions_left"], first.data["rank"]) == ("bob", 2, None)


def test_a_car_is_submitted_evaluated_and_ranked(bob, race, now, as_racer):
    client, model = as_racer(bob), a_model(bob)
    sent = client.post(address(race, "submissions/"), {"model": model.public_id})
    assert sent.status_code == 201, sent.data
    assert (sent.data["number"], sent.data["state"], sent.data["score_ms"]) == (1, "queued", None)
    finish(Submission.objects.get(), laps(11_000, 10_000, 12_000), now)
    row = client.get(address(race, "submissions/")).data["results"][0]
    assert row["evaluation"] == sent.data["evaluation"]
    assert (row["state"], row["average_ms"], row["best_lap_ms"], row["is_best"]) == ("finished", 11_000, 10_000, True)
    entry = client.get(address(race, "entry/")).data
    assert (entry["rank"], entry["score_ms"], entry["evaluation"]) == (1, 11_000, sent.data["evaluation"])


def test_a_repeated_car_is_refused_with_its_evaluation(bob, race, now, as_racer):
    standing = drive(race, bob, laps(10_000, 10_000, 10_000), now).evaluation
    answer = as_racer(bob).post(address(race, "submissions/"), {"model": standing.model.public_id})
    assert (answer.status_code, answer.data["code"]) == (409, "car_already_submitted")
    assert answer.data["params"] == {"evaluation": standing.public_id}


def test_submissions_are_limited_and_one_at_a_time(bob, race, now, as_racer):
    client = as_racer(bob)
    codes = []
    for _ in range(3):
        answer = client.post(address(race, "submissions/"), {"model": a_model(bob).public_id})
        codes.append(answer.data.get("code"))
        if codes[-1] is None:
            blocked = client.post(address(race, "submissions/"), {"model": a_model(bob).public_id})
            assert (blocked.status_code, blocked.data["code"]) == (409, "submission_running")
            finish(Submission.objects.first(), laps(10_000, 10_000, 10_000), now)
    assert codes == [None, None, "submissions_used_up"]


def test_a_failure_of_the_platform_is_shown_as_refunded(bob, race, now, as_racer):
    client = as_racer(bob)
    client.post(address(race, "submissions/"), {"model": a_model(bob).public_id})
    fail(Submission.objects.get(), PlatformFault("internal_error"), now)
    row = client.get(address(race, "submissions/")).data["results"][0]
    assert (row["state"], row["reason_code"], row["refunded"], row["is_void"]) == (
        "failed",
        "platform_gave_up",
        True,
        True,
    )
    assert client.get(address(race, "entry/")).data["submissions_left"] == 2


def test_a_failure_of_the_car_uses_up_a_submission(bob, race, now, as_racer):
    client = as_racer(bob)
    client.post(address(race, "submissions/"), {"model": a_model(bob).public_id})
    fail(Submission.objects.get(), UserFault("non_finite_action", step=3), now)
    assert client.get(address(race, "entry/")).data["submissions_left"] == 1


def test_somebody_elses_model_is_not_found(alice, bob, race, as_racer):
    client = as_racer(bob)
    answers = [
        client.post(address(race, "submissions/"), {"model": public_id})
        for public_id in (a_model(alice).public_id, "nosuchmodel2")
    ]
    assert {(answer.status_code, answer.data["code"]) for answer in answers} == {(403, "model_not_yours")}
    assert answers[0].data == answers[1].data
    assert not Submission.objects.exists()


@pytest.mark.parametrize(
    ("times", "code"),
    [
        ({"opens_at": timedelta(days=1), "closes_at": timedelta(days=2)}, "race_not_open_yet"),
        ({"opens_at": timedelta(days=-2), "closes_at": timedelta(days=-1)}, "race_closed"),
    ],
)
def test_a_race_accepts_cars_only_while_it_is_open(bob, now, as_racer, times, code):
    race = a_race(now, **{name: now + delta for name, delta in times.items()})
    answer = as_racer(bob).post(address(race, "submissions/"), {"model": a_model(bob).public_id})
    assert (answer.status_code, answer.data["code"]) == (409, code)


def test_entering_again_after_withdrawal_restores_the_results(bob, race, now, as_racer):
    drive(race, bob, laps(10_000, 10_000, 10_000), now)
    client = as_racer(bob)
    assert client.delete(address(race, "entry/")).status_code == 204
    assert client.get(address(race, "board/")).data["count"] == 0
    assert client.get(address(race, "entry/")).data["withdrawn_at"] is not None
    refused = client.post(address(race, "submissions/"), {"model": a_model(bob).public_id})
    assert (refused.status_code, refused.data["code"]) == (409, "entry_withdrawn")
    assert client.post(address(race, "entry/")).data["rank"] == 1


def test_an_organiser_removes_a_racer_and_restores_them(bob, race, now, cast):
    drive(race, bob, laps(10_000, 10_000, 10_000), now)
    removal = address(race, "removals/bob/")
    for role, status in {"member": 403, "stranger": 403, "anonymous": 401}.items():
        assert cast[role].post(removal, {"reason": "?"}).status_code == status, role
    answer = cast["owner"].post(removal, {"reason": "Two accounts"})
    assert (answer.status_code, answer.data["removal_reason"]) == (200, "Two accounts")
    refused = cast["member"].post(address(race, "entry/"))
    assert (refused.status_code, refused.data["code"]) == (403, "entry_removed")
    assert cast["admin"].delete(removal).data["rank"] == 1
    assert cast["owner"].post(address(race, "removals/charlie/")).status_code == 404


def test_entering_needs_a_log_in(race, as_racer):
    client = as_racer(None)
    for method in ("get", "post", "delete"):
        assert getattr(client, method)(address(race, "entry/")).status_code == 401
    assert client.get(address(race, "submissions/")).status_code == 401


def test_more_submissions_need_no_more_queries(bob, now, as_racer, django_assert_num_queries):
    race = a_race(now)
    client = as_racer(bob)
    for count in (1, 3):
        while Submission.objects.count() < count:
            drive(race, bob, laps(10_000, 10_000, 10_000 + Submission.objects.count()), now)
        with django_assert_num_queries(4):  # token, race, entry, submissions
            assert client.get(address(race, "submissions/")).data["count"] == count
