"""Sending a car to a race."""

from __future__ import annotations

from datetime import timedelta

import pytest

from evaluation.garage.services import delete_model
from evaluation.models import Evaluation, State
from evaluation.running.queue.selectors import queue_position
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import PlatformFault, UserFault
from races.entries import eligibility
from races.entries.services.entries import accept_invitation, enter_race, remove_entry, withdraw
from races.entries.services.submissions import repeat_submission, submit_model
from races.models import Entry, Submission, Visibility
from tests.factories import a_model, a_race, a_racer, drive, fail, finish, laps, start
from tests.refusals import refused

pytestmark = pytest.mark.django_db


def test_a_submission_enters_the_racer_and_queues_the_run(alice, now, wakes):
    race = a_race(now, laps=2, minimum_laps=2, off_track_penalty_ms=1234, direction="cw", seed=7, max_resets=3)
    model = a_model(alice)
    submission = submit_model(race=race, racer=alice, model=model, now=now)
    evaluation = submission.evaluation
    assert (submission.number, submission.submitted_at) == (1, now)
    assert evaluation.state == State.QUEUED and queue_position(evaluation) == 1
    assert evaluation.track == race.track
    rules = evaluation.spec["rules"]
    assert rules["laps"] == 2 and rules["off_track_penalty_ms"] == 1234
    assert rules["direction"] == "cw" and rules["seed"] == 7 and rules["max_resets"] == 3
    entry = Entry.objects.get(race=race, racer=alice)
    assert (entry.submission_count, entry.last_number, entry.is_baseline) == (1, 1, False)


def test_a_house_car_is_a_baseline_and_queues_last(now):
    race = a_race(now)
    house = a_racer("house-steady", is_house=True)
    first = submit_model(race=race, racer=house, model=a_model(house), now=now)
    racer = a_racer()
    second = submit_model(race=race, racer=racer, model=a_model(racer), now=now + timedelta(minutes=1))
    assert first.entry.is_baseline
    assert queue_position(second.evaluation) == 1


def test_a_race_accepts_cars_from_opening_until_closing(alice, now):
    race = a_race(now, opens_at=now, closes_at=now + timedelta(hours=1))
    model = a_model(alice)
    refused("race_not_open_yet", submit_model, race=race, racer=alice, model=model, now=now - timedelta(microseconds=1))
    refused("race_closed", submit_model, race=race, racer=alice, model=model, now=race.closes_at)
    assert submit_model(race=race, racer=alice, model=model, now=race.closes_at - timedelta(microseconds=1))
    other = a_race(now, opens_at=now, closes_at=now + timedelta(hours=1))
    assert submit_model(race=other, racer=alice, model=model, now=now)


def test_a_car_sent_before_the_close_counts_even_if_driven_later(alice, now):
    race = a_race(now)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=race.closes_at - timedelta(seconds=1))
    finish(submission, laps(9_000, 9_000, 9_000), race.closes_at + timedelta(hours=1))
    assert Entry.objects.get(race=race).classified


def test_a_cancelled_race_refuses_cars_and_says_why(alice, now):
    race = a_race(now, cancelled_at=now, cancel_reason="The track is flooded.")
    fault = refused("race_cancelled", submit_model, race=race, racer=alice, model=a_model(alice), now=now)
    assert "flooded" in str(fault)


def test_a_foreign_or_deleted_model_cannot_be_submitted(alice, bob, now):
    race = a_race(now)
    model = a_model(bob)
    refused("model_not_yours", submit_model, race=race, racer=alice, model=model, now=now)
    delete_model(model=model, now=now)
    refused("model_not_yours", submit_model, race=race, racer=bob, model=model, now=now)
    assert not Entry.objects.exists(), "a refused car enters nobody"


def test_unsupported_sensors_are_refused_naming_both_lists(alice, now):
    race = a_race(now)
    model = a_model(alice)
    model.metadata = model.metadata | {"sensor": ["STEREO_CAMERAS", "LIDAR"]}
    model.save()
    fault = refused("sensors_not_offered", submit_model, race=race, racer=alice, model=model, now=now)
    assert fault.params == {"needed": "STEREO_CAMERAS, LIDAR", "offered": "FRONT_FACING_CAMERA"}


def test_the_legacy_name_of_the_front_camera_is_accepted(alice, now):
    model = a_model(alice)
    model.metadata = model.metadata | {"sensor": ["observation"]}
    model.save()
    assert submit_model(race=a_race(now), racer=alice, model=model, now=now)


def test_a_repeated_car_is_refused_with_a_link_to_its_result(alice, now):
    race = a_race(now)
    first = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    fault = refused(
        "car_already_submitted", submit_model, race=race, racer=alice, model=first.evaluation.model, now=now
    )
    assert fault.params == {"evaluation": first.evaluation.public_id}
    assert Evaluation.objects.count() == 1


def test_a_car_deleted_and_uploaded_again_is_the_same_car(alice, now):
    race = a_race(now)
    first = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    old = first.evaluation.model
    delete_model(model=old, now=now)
    again = a_model(alice)
    again.network = old.network
    again.save()
    refused("car_already_submitted", submit_model, race=race, racer=alice, model=again, now=now)


def test_one_racer_may_send_a_car_to_two_races(alice, now):
    first = drive(a_race(now), alice, laps(9_000, 9_000, 9_000), now)
    assert submit_model(race=a_race(now), racer=alice, model=first.evaluation.model, now=now)


def test_a_racer_has_one_pending_car_at_a_time(alice, now):
    race = a_race(now)
    first = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    second = a_model(alice)
    fault = refused("submission_running", submit_model, race=race, racer=alice, model=second, now=now)
    assert fault.params == {"evaluation": first.evaluation.public_id}
    start(first.evaluation, now)
    refused("submission_running", submit_model, race=race, racer=alice, model=second, now=now)
    assert submit_model(race=a_race(now), racer=alice, model=second, now=now), "another race does not mind"


def test_the_limit_of_submissions_is_enforced(alice, now):
    race = a_race(now, max_submissions=2)
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    drive(race, alice, laps(9_100, 9_000, 9_000), now)
    refused("submissions_used_up", submit_model, race=race, racer=alice, model=a_model(alice), now=now)
    assert Entry.objects.get(race=race).submission_count == 2


def test_a_car_failing_by_its_own_fault_uses_up_the_submission(alice, now):
    race = a_race(now, max_submissions=2)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(submission, UserFault("non_finite_action", step=3), now)
    entry = Entry.objects.get(race=race)
    assert (entry.submission_count, entry.classified) == (1, False)
    refused("car_already_submitted", submit_model, race=race, racer=alice, model=submission.evaluation.model, now=now)


def test_a_failure_of_the_platform_refunds_the_submission(alice, now):
    race = a_race(now, max_submissions=1)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(submission, PlatformFault("internal_error"), now)
    submission.refresh_from_db()
    entry = Entry.objects.get(race=race)
    assert submission.refunded and submission.is_void
    assert (entry.submission_count, entry.last_number) == (0, 1)
    again = submit_model(race=race, racer=alice, model=submission.evaluation.model, now=now)
    assert again.number == 2, "a number is never given twice"
    finish(again, laps(9_000, 9_000, 9_000), now)
    assert Entry.objects.get(race=race).classified


def test_stopping_a_waiting_car_refunds_the_submission(alice, now):
    race = a_race(now, max_submissions=1)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert stop_evaluation(evaluation=submission.evaluation, now=now)
    entry = Entry.objects.get(race=race)
    assert entry.submission_count == 0
    assert submit_model(race=race, racer=alice, model=submission.evaluation.model, now=now).number == 2


def test_stopping_a_car_on_track_uses_up_the_submission(alice, now):
    race = a_race(now, max_submissions=1)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    running = start(submission.evaluation, now)
    assert stop_evaluation(evaluation=running, now=now)
    submission.refresh_from_db()
    assert submission.is_void and not submission.refunded
    refused("submissions_used_up", submit_model, race=race, racer=alice, model=a_model(alice), now=now)


def test_a_car_stopped_on_track_may_be_sent_again(alice, now):
    race = a_race(now, max_submissions=2)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    stop_evaluation(evaluation=start(submission.evaluation, now), now=now)
    again = submit_model(race=race, racer=alice, model=submission.evaluation.model, now=now)
    assert again.number == 2
    assert Entry.objects.get(race=race).submission_count == 2


def test_withdrawn_and_removed_racers_cannot_submit(alice, bob, now):
    race = a_race(now, organiser=bob)
    entry = enter_race(race=race, racer=alice, now=now)
    withdraw(entry=entry, now=now)
    refused("entry_withdrawn", submit_model, race=race, racer=alice, model=a_model(alice), now=now)
    remove_entry(entry=entry, by=bob, now=now)
    refused("entry_removed", submit_model, race=race, racer=alice, model=a_model(alice), now=now)


def test_an_invitation_race_accepts_cars_of_members_only(alice, bob, now):
    race = a_race(now, organiser=bob, visibility=Visibility.INVITATION)
    refused("race_needs_invitation", submit_model, race=race, racer=alice, model=a_model(alice), now=now)
    accept_invitation(token=race.invitation, racer=alice, now=now)
    assert submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert submit_model(race=race, racer=bob, model=a_model(bob), now=now), "the organiser needs no link"


def test_a_registered_eligibility_check_refuses_entry_and_car(alice, now, monkeypatch):
    def nobody(race, racer, now):
        raise UserFault("race_pro_only")

    race = a_race(now)
    enter_race(race=race, racer=alice, now=now)
    monkeypatch.setattr(eligibility, "CHECKS", [nobody])
    refused("race_pro_only", submit_model, race=race, racer=alice, model=a_model(alice), now=now)
    refused("race_pro_only", enter_race, race=race, racer=a_racer(), now=now)
    house = a_racer(is_house=True)
    assert submit_model(race=race, racer=house, model=a_model(house), now=now), "house cars race everywhere"


def test_a_run_repeated_by_an_admin_keeps_its_submission_time(alice, now):
    race = a_race(now)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(submission, PlatformFault("internal_error"), now)
    later = race.closes_at + timedelta(days=1)
    again = repeat_submission(submission=submission, now=later)
    assert (again.number, again.submitted_at) == (2, now)
    finish(again, laps(9_000, 9_000, 9_000), later)
    entry = Entry.objects.get(race=race)
    assert entry.classified and entry.achieved_at == now
    assert entry.submission_count == 1, "it counts once, now that it has a result"


def test_a_repeated_run_counts_once(alice, now):
    race = a_race(now)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(submission, UserFault("non_finite_action", step=3), now)
    again = repeat_submission(submission=submission, now=now)
    finish(again, laps(9_000, 9_000, 9_000), now)
    assert Entry.objects.get(race=race).submission_count == 1
    assert Submission.objects.filter(is_void=False).count() == 1


def test_a_finished_run_cannot_be_repeated(alice, now):
    submission = drive(a_race(now), alice, laps(9_000, 9_000, 9_000), now)
    refused("submission_not_failed", repeat_submission, submission=submission, now=now)


def test_a_failed_run_can_be_repeated_only_once(alice, now):
    race = a_race(now)
    submission = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(submission, PlatformFault("internal_error"), now)
    repeat_submission(submission=submission, now=now)
    refused("car_already_submitted", repeat_submission, submission=submission, now=now)
    assert Entry.objects.get(race=race).last_number == 2
