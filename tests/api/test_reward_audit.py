"""The audit of a reward function over the API."""

from __future__ import annotations

import pytest

from tests.factories import a_track
from tests.training.audit.driven import driven
from tests.training.audit.shapes import SHAPES
from training.rewards.audit import drives as recorded

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/reward-functions/audit/"
CONSTANT = SHAPES["a constant"]


@pytest.fixture(autouse=True)
def driven_once(monkeypatch):
    monkeypatch.setattr(recorded, "eight_drives", driven)


def test_the_api_answers_findings_and_the_eight_drives(alice, as_racer):
    track = a_track()
    answer = as_racer(alice).post(ADDRESS, {"reward_code": CONSTANT, "track": track.slug})
    assert answer.status_code == 200
    said = answer.json()
    by_code = {one["code"]: one for one in said["findings"]}
    assert by_code["reward_standing_pays"]["verdict"] == "bad"
    assert by_code["reward_pays_slow"]["message"].startswith("A slow lap is worth 0.8")
    drives = {one["drive"]: one for one in said["drives"]}
    assert list(drives) == list(recorded.DRIVES)
    assert drives["standing"]["rank_by_reward"] == 1
    assert drives["fast"]["total"] == drives["fast"]["steps"]
    assert said["progress_correlation"] < 0 < said["lap_time_correlation"]
    assert (said["problems"], said["warnings"]) == ([], [])


def test_the_discount_factor_counts(alice, as_racer):
    sent = {"reward_code": CONSTANT, "track": a_track().slug}
    worth = [
        as_racer(alice).post(ADDRESS, sent | {"discount_factor": factor}).json()["drives"][0]["worth"]
        for factor in (0.5, 0.97)
    ]
    assert worth[1] < worth[0] < 1.0


def test_a_function_that_fails_has_its_line_its_steps_and_its_drive(alice, as_racer):
    sent = {"reward_code": SHAPES["a text"], "track": a_track().slug}
    said = as_racer(alice).post(ADDRESS, sent).json()
    (problem,) = said["problems"]
    assert (problem["code"], problem["line"], problem["drive"], problem["step"]) == (
        "reward_not_a_number",
        2,
        "fast",
        1,
    )
    assert problem["count"] == sum(one["failed"] for one in said["drives"])


def test_a_function_that_is_no_python_has_no_drives(alice, as_racer):
    said = as_racer(alice).post(ADDRESS, {"reward_code": "def", "track": a_track().slug}).json()
    assert [problem["code"] for problem in said["problems"]] == ["reward_syntax"]
    assert (said["drives"], said["findings"], said["progress_correlation"]) == ([], [], None)


@pytest.mark.slow
def test_a_slow_function_is_bounded_and_answers_for_the_drives_that_it_reached(alice, as_racer):
    slow = "def reward_function(params):\n    sum(range(400_000))\n    return 1.0\n"
    said = as_racer(alice).post(ADDRESS, {"reward_code": slow, "track": a_track().slug}).json()
    assert [one["code"] for one in said["warnings"]] == ["reward_slow_in_all"]
    reached = [one["worth"] is not None for one in said["drives"]]
    assert reached[0] and not reached[-1]
    assert {one["rank_by_reward"] for one in said["drives"] if one["worth"] is None} <= {None}
    assert said["problems"] == []


@pytest.mark.slow
def test_an_endless_function_ends_with_its_line(alice, as_racer):
    endless = "def reward_function(params):\n    while params['progress'] > 50:\n        pass\n    return 1.0\n"
    said = as_racer(alice).post(ADDRESS, {"reward_code": endless, "track": a_track().slug}).json()
    (problem,) = said["problems"]
    assert (problem["code"], problem["line"] in (2, 3), problem["drive"]) == ("reward_too_slow", True, "fast")
    assert not any(one["worth"] for one in said["drives"])


def test_wrong_bodies_are_refused(alice, as_racer):
    good = {"reward_code": CONSTANT, "track": a_track().slug}
    client = as_racer(alice)
    for wrong in ({"track": "nowhere"}, {"discount_factor": 1.5}, {"direction": "up"}, {"level": 1}):
        assert client.post(ADDRESS, good | wrong).status_code == 400, wrong
    assert client.post(ADDRESS, {"reward_code": CONSTANT}).status_code == 400
    assert as_racer(None).post(ADDRESS, good).status_code == 401
