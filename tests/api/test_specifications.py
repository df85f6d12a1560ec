"""What a run is told, through the API: all that is needed to drive it again, and nothing that is not yours to see."""

from __future__ import annotations

import pytest
from django.utils import timezone

from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from races.models import Visibility
from races.rules.layout import race_rules
from tests.factories import a_model, a_race, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


def test_a_race_tells_all_that_the_simulator_is_told(now, as_racer):
    race = a_race(now, race_type="object_avoidance", random_boxes=3, seed=7, direction="cw")
    told = as_racer(None).get(f"/api/v1/races/{race.slug}/specification/").json()
    assert told["engine"] == ENGINE_ID
    assert told["track"]["fingerprint"] == race.track.fingerprint and told["track"]["direction"] == "cw"
    assert told["track"]["look"] == race.track.look
    assert RaceRules.from_dict(told["rules"]) == race_rules(race)


def test_a_race_by_invitation_tells_only_those_who_see_it(now, alice, bob, charlie, sam, as_racer):
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    path = f"/api/v1/races/{race.slug}/specification/"
    assert [as_racer(who).get(path).status_code for who in (alice, bob, charlie, sam, None)] == [
        200, 404, 404, 200, 404,
    ]  # fmt: skip


def test_a_run_tells_its_cars_and_their_hashes(now, bob, charlie, as_racer):
    evaluation = drive(a_race(now), bob, laps(11_000, 10_000, 12_000), now).evaluation
    path = f"/api/v1/evaluations/{evaluation.public_id}/specification/"
    told = as_racer(charlie).get(path).json()
    (car,) = told["cars"]
    assert told["rules"] == evaluation.spec["rules"] and told["state"] == "finished"
    assert car["trace_sha256"] == evaluation.result.trace_sha256
    assert (car["racer"], car["model"]["public_id"]) == ("bob", evaluation.model.public_id)


def test_a_network_is_open_to_its_owner_and_when_it_is_shared(now, bob, charlie, as_racer):
    evaluation = drive(a_race(now), bob, laps(11_000, 10_000, 12_000), now).evaluation
    path = f"/api/v1/evaluations/{evaluation.public_id}/specification/"

    def is_open(who):
        return as_racer(who).get(path).json()["cars"][0]["open"]

    assert [is_open(who) for who in (bob, charlie, None)] == [True, False, False]
    evaluation.model.shared_at = now
    evaluation.model.save()
    assert [is_open(who) for who in (bob, charlie, None)] == [True, True, False]


def test_a_waiting_run_has_no_hash_and_is_its_owners_own(now, bob, charlie, as_racer):
    from races.entries.services.submissions import submit_model

    evaluation = submit_model(race=a_race(now), racer=bob, model=a_model(bob), now=now).evaluation
    path = f"/api/v1/evaluations/{evaluation.public_id}/specification/"
    told = as_racer(bob).get(path).json()
    assert (told["state"], told["cars"][0]["trace_sha256"], told["engine"]) == ("queued", "", ENGINE_ID)
    assert as_racer(charlie).get(path).status_code == 404
