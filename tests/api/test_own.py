"""Runs of one's own through the API."""

from __future__ import annotations

import pytest
from django.utils import timezone

from evaluation.garage.services import share_model
from races.entries.services.submissions import submit_model
from races.models import OwnEvaluation
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.races.test_own import finish

pytestmark = pytest.mark.django_db
AT = "/api/v1/evaluations/"


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture(autouse=True)
def _no_broker(wakes):
    """No worker is called."""


def test_a_run_is_asked_for_with_every_rule(alice, bob, now, as_racer):
    rival = a_model(bob)
    share_model(model=rival, now=now)
    said = {"model": a_model(alice).public_id, "track": a_track().slug, "rivals": [rival.public_id]}
    said |= {"race_type": "head_to_head", "opponents": "models", "laps": 2, "seed": 3, "start_m": 0.5}
    said |= {"ranking_method": "best", "minimum_laps": 1, "collision_penalty_ms": 100}
    answer = as_racer(alice).post(AT, said, format="json")
    assert answer.status_code == 201, answer.data
    assert answer.data["rules"]["start_m"] == 0.5 and answer.data["rules"]["collision_penalty_ms"] == 100
    assert [one["racer"] for one in answer.data["rivals"]] == ["bob"]
    own = answer.data["own"]
    assert (own["ranking_method"], own["minimum_laps"], own["race"], own["would_be"]) == ("best", 1, None, None)


def test_as_in_a_race_a_run_says_what_it_would_be(alice, now, as_racer):
    race, client = a_race(now), as_racer(alice)
    drive(race, a_racer(), laps(*[9_000] * 3), now)
    said = {"model": a_model(alice).public_id, "race": race.slug, "submit_if_better": True}
    made = client.post(AT, said, format="json").data
    own = OwnEvaluation.objects.get(evaluation__public_id=made["public_id"])
    finish(own, laps(*[10_000] * 3), now)
    told = client.get(f"{AT}{made['public_id']}/").data["own"]
    assert told["would_be"] == {"rank": 2, "racers": 2, "is_better": True}
    assert (told["score_ms"], told["classified"], told["submit_reason"]) == (10_000, True, None)
    assert client.get(f"{AT}{told['submitted']}/").data["race"]["slug"] == race.slug


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ({"model": "nobody"}, "own_model_gone"),
        ({"race": "nowhere"}, "own_race_gone"),
        ({"rivals": ["nobody"], "race_type": "head_to_head"}, "own_rival_gone"),
        ({"race_type": "object_avoidance"}, "race_needs_boxes"),
        ({"start_m": 999}, "own_start"),
        ({"submit_if_better": True}, "own_without_race"),
        ({"laps": 21}, "invalid"),
        ({"shared_cars": True}, "invalid"),
    ],
)
def test_what_is_wrong_is_refused_with_its_code(alice, as_racer, said, code):
    answer = as_racer(alice).post(
        AT, {"model": a_model(alice).public_id, "track": a_track().slug} | said, format="json"
    )
    assert (answer.status_code, answer.data["code"]) == (404 if code.endswith("_gone") else 400, code), answer.data
    assert not OwnEvaluation.objects.exists()


def test_the_list_is_ones_own_and_is_filtered(alice, bob, now, as_racer):
    fast, slow, race = a_model(alice), a_model(alice), a_race(now)
    runs = [
        drive_own(owner=alice, model=fast, track=a_track(), now=now),
        drive_own(owner=alice, model=slow, race=race, now=now),
        drive_own(owner=alice, model=slow, track=a_track(), now=now, race_type="head_to_head", bots=1),
    ]
    finish(runs[0], laps(9_000), now)
    drive_own(owner=bob, model=a_model(bob), track=a_track(), now=now)
    submit_model(race=race, racer=alice, model=fast, now=now)
    first, second, third = [own.evaluation.public_id for own in runs]
    client = as_racer(alice)
    for query, found in (
        ("", [third, second, first]),
        (f"?model={slow.public_id}", [third, second]),
        ("?state=finished", [first]),
        (f"?race={race.slug}", [second]),
        ("?race_type=head_to_head", [third]),
        ("?track=nowhere", []),
    ):
        assert [one["public_id"] for one in client.get(AT + query).data["results"]] == found, query
    assert client.get(f"{AT}?state=nothing").status_code == 400
    assert client.get(f"{AT}?state=finished").data["results"][0]["best_lap_ms"] == 9_000


def test_a_run_is_stopped_driven_again_and_deleted(alice, bob, now, as_racer):
    own = drive_own(owner=alice, model=a_model(alice), track=a_track(), now=now)
    at, client = f"{AT}{own.evaluation.public_id}/", as_racer(alice)
    for call in (as_racer(bob).get, as_racer(bob).delete, as_racer(bob).post):
        assert call(at if call.__name__ != "post" else f"{at}again/").status_code == 404
    assert client.delete(at).data["code"] == "own_under_way"
    assert client.post(f"{at}stop/").data["state"] == "stopped"
    again = client.post(f"{at}again/")
    assert again.status_code == 201 and again.data["state"] == "queued"
    assert client.delete(at).status_code == 204
    assert client.get(at).status_code == 404


def test_what_was_sent_to_a_race_is_neither_driven_again_nor_deleted(alice, now, as_racer):
    sent = drive(a_race(now), alice, laps(*[9_000] * 3), now)
    at, client = f"{AT}{sent.evaluation.public_id}/", as_racer(alice)
    assert client.delete(at).data["code"] == client.post(f"{at}again/").data["code"] == "own_only"
    assert client.get(at).data["own"] is None
