"""A racer's own runs: any car on any track, for nobody else."""

from __future__ import annotations

from datetime import timedelta
from importlib import import_module

import pytest
from django.apps import apps
from django.db import transaction
from django.test import Client

from accounts.models import RacerQuota
from accounts.quotas import used_by
from evaluation.garage.services import delete_model, share_model, stop_sharing_model
from evaluation.models import Evaluation, State
from evaluation.running.competitors import live_cars
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.order import OWN, URGENT
from evaluation.running.queue.selectors import queue_position
from evaluation.running.queue.services import stop_evaluation
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import CATALOGUE
from races.entries.selectors.visibility import can_see_evaluation, evaluations_visible_to
from races.entries.services.submissions import submit_model
from races.errors import RaceRefused
from races.models import Entry, OwnEvaluation, Race, Submission
from races.pages.services import create_community_race
from races.test_runs.selectors import can_stop_run, is_own_of, own_result, own_runs_of
from races.test_runs.services import delete_own, drive_own, drive_own_again
from tests.factories import a_model, a_race, a_racer, a_track, break_down, drive, lap, laps, outcome, start
from tests.refusals import refused
from tests.rows import track_row
from tracks.models import Track

pytestmark = pytest.mark.django_db
HEAD = {"race_type": "head_to_head"}
BOXES = {"race_type": "object_avoidance"}


def finish(own, driven, now):
    """Let the run drive these laps."""
    running = start(own.evaluation, now)
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(driven), now=now)
    return OwnEvaluation.objects.select_related("race__track", "evaluation__result", "owner").get(pk=own.pk)


def ask(owner, now, **said):
    if "race" not in said:
        said.setdefault("track", a_track())
    return drive_own(owner=owner, model=said.pop("model", None) or a_model(owner), now=now, **said)


# --- what may be asked for -------------------------------------------------------------------------------------------


def test_a_run_drives_by_all_that_its_racer_chose(alice, now):
    own = ask(alice, now, laps=7, direction="cw", seed=5, start_m=2.5, off_track_penalty_ms=0, ranking_method="best")
    rules = own.evaluation.spec["rules"]
    assert (rules["laps"], rules["direction"], rules["seed"], rules["start_m"]) == (7, "cw", 5, 2.5)
    assert (own.ranking_method, own.minimum_laps, rules["off_track_penalty_ms"]) == ("best", 3, 0)
    assert own.evaluation.state == State.QUEUED


def test_laps_in_a_row_are_no_more_than_are_driven_unless_somebody_says_so(alice, now):
    assert ask(alice, now, laps=1).minimum_laps == 1
    assert ask(alice, now, laps=5, ranking_method="total").minimum_laps == 5


def test_what_is_left_out_of_a_race_among_cars_is_seen_from_who_is_named(alice, bob, now):
    bots = ask(alice, now, **HEAD, bots=2)
    mine, theirs = a_model(alice), a_model(bob)
    share_model(model=theirs, now=now)
    rivals = ask(alice, now, **HEAD, rivals=[mine, theirs])
    assert (bots.rules.bots, rivals.rules.bots) == (2, 0)
    assert [rival.model for rival in rivals.evaluation.rivals.order_by("number")] == [mine, theirs]


def test_a_car_that_is_shared_and_a_house_car_may_be_driven_by_everybody(alice, bob, now):
    shared, house = a_model(bob), a_model(a_racer("house", is_house=True))
    share_model(model=shared, now=now)
    for model in (shared, house):
        assert ask(alice, now, model=model).evaluation.owner == alice


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ({"laps": 21}, "race_field"),
        ({"laps": 2, "minimum_laps": 3}, "race_minimum_laps"),
        ({"start_m": 1000.0}, "own_start"),
        ({"start_m": float("nan")}, "own_start"),
        ({**BOXES}, "race_needs_boxes"),
        ({**BOXES, "boxes": [{"fraction": 0.95, "lane": "inner"}]}, "race_box_place"),
        ({**BOXES, "boxes": [{"fraction": 0.5, "lane": "inner"}] * 2}, "boxes_overlap"),
        ({**BOXES, "random_boxes": 10, "box_distance_m": 20.0}, "boxes_do_not_fit"),
        ({**HEAD}, "race_needs_opponents"),
        ({**HEAD, "opponents": "models"}, "own_needs_rivals"),
        ({**HEAD, "opponents": "bots"}, "race_bot_count"),
        ({"bots": 3}, "race_has_no_opponents"),
        ({"track": None}, "own_needs_track"),
        ({"submit_if_better": True}, "own_without_race"),
    ],
)
def test_what_cannot_be_driven_is_refused_and_nothing_is_queued(alice, now, said, code):
    refused(code, ask, owner=alice, now=now, **said)
    assert not Evaluation.objects.exists() and not OwnEvaluation.objects.exists()


@pytest.mark.parametrize(
    ("said", "code"), [({"start_m": 1.0}, "track_start_fixed"), ({**HEAD, "bots": 1}, "track_needs_loop"), ({}, None)]
)
def test_an_open_track_is_driven_alone_and_from_its_start(alice, now, said, code):
    straight = track_row("straight-track")
    if code:
        refused(code, ask, owner=alice, now=now, track=straight, **said)
    else:
        assert ask(alice, now, track=straight).evaluation.track == straight


def test_rivals_are_refused_where_they_cannot_race(alice, now):
    cars = [a_model(alice) for _ in range(4)]
    refused("rivals_race_type", ask, owner=alice, now=now, rivals=cars[:1])
    refused("race_bot_count", ask, owner=alice, now=now, rivals=cars[:1], **HEAD, opponents="bots")
    refused("rivals_with_bots", ask, owner=alice, now=now, rivals=cars[:1], **HEAD, opponents="bots", bots=2)
    refused("too_many_rivals", ask, owner=alice, now=now, rivals=cars, **HEAD)


def test_a_car_that_is_not_to_be_used_any_more_is_refused_with_a_reason(alice, bob, now):
    gone, theirs = a_model(alice), a_model(bob)
    share_model(model=theirs, now=now)
    stop_sharing_model(model=theirs)
    delete_model(model=gone, now=now)
    theirs.refresh_from_db()
    for model in (gone, theirs):
        refused("own_model_gone", ask, owner=alice, now=now, model=model)
    fault = refused("own_rival_gone", ask, owner=alice, now=now, rivals=[a_model(alice), theirs], **HEAD)
    assert fault.params == {"number": 2}


def test_a_track_whose_shape_is_unknown_takes_no_car(alice, now):
    named = {"slug": "old", "name": "Old", "fingerprint": "unknown:1", "npy": b"", "direction": "ccw"}
    track = Track.objects.create(**named, created_at=now)
    refused("race_track_without_shape", ask, owner=alice, now=now, track=track)


def test_a_track_without_a_way_round_is_driven_alone_from_its_start(alice, now):
    track = track_row(next(one.slug for one in CATALOGUE if one.is_open))
    assert ask(alice, now, track=track, laps=1).rules.laps == 1
    refused("track_start_fixed", ask, owner=alice, now=now, track=track, start_m=1.0)
    refused("track_needs_loop", ask, owner=alice, now=now, track=track, rivals=[a_model(alice)], **HEAD)
    refused("track_needs_loop", ask, owner=alice, now=now, track=track, bots=1, **HEAD)
    assert OwnEvaluation.objects.count() == 1


def test_all_that_is_wrong_is_told_at_once_each_with_its_field(alice, now):
    with pytest.raises(RaceRefused) as caught:
        ask(alice, now, laps=30, max_simulated_ms=1, start_m=-1.0)
    assert set(caught.value.errors.error_dict) == {"laps", "max_simulated_ms", "start_m"}


# --- as in a race ----------------------------------------------------------------------------------------------------


def test_as_in_a_race_takes_its_track_its_rules_and_what_it_ranks_by(alice, now):
    race = a_race(now, laps=4, minimum_laps=2, ranking_method="best", direction="cw", seed=9, off_track_penalty_ms=500)
    own = ask(alice, now, race=race)
    entered = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert own.evaluation.spec["rules"] == entered.evaluation.spec["rules"]
    assert (own.evaluation.track, own.ranking_method, own.minimum_laps) == (race.track, "best", 2)


def test_a_race_takes_no_rules_beside_its_own(alice, now):
    race = a_race(now)
    refused("own_as_in_race", ask, owner=alice, now=now, race=race, laps=1)
    refused("own_as_in_race", ask, owner=alice, now=now, race=race, track=race.track)
    refused("own_as_in_race", ask, owner=alice, now=now, race=race, rivals=[a_model(alice)])


def test_nobody_drives_as_in_a_race_that_they_do_not_see(alice, now):
    refused("own_race_gone", ask, owner=alice, now=now, race=a_race(now, visibility="invitation"))
    imported = a_race(now, imported_at=now)
    refused("race_recorded", ask, owner=alice, now=now, race=imported)


def test_a_run_says_which_place_it_would_have(alice, now):
    race = a_race(now)
    for times in ([9_000] * 3, [10_000] * 3, [11_000] * 3, [12_000] * 3):
        drive(race, a_racer(), laps(*times), now)
    drive(race, a_racer("house", is_house=True), laps(*[5_000] * 3), now)
    worth = own_result(own := finish(ask(alice, now, race=race), laps(*[10_500] * 3), now), own.evaluation.result)
    assert (worth.would_be.rank, worth.would_be.racers, worth.standing.score_ms) == (3, 5, 10_500)
    equal = finish(ask(alice, now, race=race), laps(*[10_000] * 3), now)
    assert own_result(equal, equal.evaluation.result).would_be.rank == 3, "who came earlier stands before"


def test_the_place_is_the_one_that_the_racer_would_have_by_this_run_alone(alice, now):
    race = a_race(now)
    drive(race, a_racer(), laps(*[10_000] * 3), now)
    drive(race, alice, laps(*[9_000] * 3), now)
    slower = finish(ask(alice, now, race=race), laps(*[11_000] * 3), now)
    worth = own_result(slower, slower.evaluation.result)
    assert (worth.would_be.rank, worth.would_be.racers, worth.would_be.change.is_better) == (2, 2, False)


@pytest.mark.parametrize("scores", [[0], [1, 255, 256, 257, 65_535, 65_536, 70_000], [16_777_216, 16_777_215]])
def test_places_are_counted_as_the_board_sorts(alice, now, scores):
    race = a_race(now, laps=1, minimum_laps=1, max_simulated_ms=1_200_000)
    for score in scores:
        drive(race, a_racer(), [lap(1, max(1, score))], now)
    for score in scores:
        own = finish(ask(alice, now, race=race), [lap(1, max(1, score))], now)
        better_or_equal = sum(other <= score for other in scores)
        assert own_result(own, own.evaluation.result).would_be.rank == 1 + better_or_equal


def test_no_place_where_nothing_can_be_compared(alice, now):
    race = a_race(now)
    own = finish(ask(alice, now, race=race), laps(*[10_000] * 3), now)
    not_classified = finish(ask(alice, now, race=race), [lap(1, complete=False)], now)
    assert own_result(not_classified, not_classified.evaluation.result).would_be is None
    race.engine = "paddock-v0"
    race.save()
    own.race.refresh_from_db()
    assert own_result(own, own.evaluation.result).fault.code == "own_other_engine"
    race.laps, race.engine = 5, ""
    race.save()
    own.race.refresh_from_db()
    assert own_result(own, own.evaluation.result).fault.code == "own_race_changed"


# --- submit if better ------------------------------------------------------------------------------------------------


def test_a_better_run_is_submitted_once_with_its_end(alice, now):
    race, model = a_race(now), a_model(alice)
    drive(race, alice, laps(*[11_000] * 3), now)
    own = finish(ask(alice, now, race=race, model=model, submit_if_better=True), laps(*[10_000] * 3), now)
    sent = Submission.objects.get(evaluation__model=model)
    assert own.submission == sent and sent.evaluation != own.evaluation and sent.evaluation.state == State.QUEUED
    assert own.submit_reason_code == ""


def test_a_first_run_that_would_be_classified_is_better_than_nothing(alice, now):
    race = a_race(now)
    own = finish(ask(alice, now, race=race, submit_if_better=True), laps(*[10_000] * 3), now)
    assert own.submission.entry == Entry.objects.get(race=race, racer=alice)


@pytest.mark.parametrize(
    ("driven", "code"),
    [(laps(*[12_000] * 3), "own_not_better"), ([lap(1, complete=False)], "own_not_classified")],
)
def test_a_run_that_is_not_better_is_not_submitted_and_says_why(alice, now, driven, code):
    race = a_race(now)
    drive(race, alice, laps(*[11_000] * 3), now)
    own = finish(ask(alice, now, race=race, submit_if_better=True), driven, now)
    assert own.submission is None and own.submit_reason_code == code and own.submit_reason
    assert Submission.objects.count() == 1


def test_a_submission_failing_through_us_is_told_and_the_run_stands(alice, now, monkeypatch):
    def broken(**_):
        raise RuntimeError("the disk is full")

    monkeypatch.setattr("races.test_runs.services.submit_model", broken)
    own = finish(ask(alice, now, race=a_race(now), submit_if_better=True), laps(*[10_000] * 3), now)
    assert own.submit_reason_code == "own_submit_failed" and own.evaluation.state == State.FINISHED


def test_what_the_race_refuses_meanwhile_is_told_and_the_run_stands(alice, now):
    race = a_race(now, closes_at=now + timedelta(hours=1))
    own = ask(alice, now, race=race, submit_if_better=True)
    own = finish(own, laps(*[10_000] * 3), now + timedelta(hours=2))
    assert own.submit_reason_code == "race_closed" and own.evaluation.state == State.FINISHED
    assert not Submission.objects.exists()


def test_what_the_race_would_refuse_today_is_refused_at_once(alice, bob, now):
    closed = a_race(now, closes_at=now - timedelta(hours=1), opens_at=now - timedelta(days=2))
    refused("race_closed", ask, owner=alice, now=now, race=closed, submit_if_better=True)
    shared = a_model(bob)
    share_model(model=shared, now=now)
    refused("model_not_yours", ask, owner=alice, now=now, race=a_race(now), model=shared, submit_if_better=True)
    stereo = a_race(now, sensors=["STEREO_CAMERAS"])
    refused("sensors_not_offered", ask, owner=alice, now=now, race=stereo, submit_if_better=True)
    assert ask(alice, now, race=closed), "to try it is no submission"


def test_a_run_whose_end_is_undone_has_submitted_nothing(alice, now):
    """A worker that dies before the commit: the run comes again, and then it is submitted once."""
    own = ask(alice, now, race=a_race(now), submit_if_better=True)
    running = start(own.evaluation, now)
    done = {"pk": running.pk, "lease": running.lease, "outcome": outcome(laps(*[10_000] * 3)), "now": now}

    class KilledError(Exception):
        pass

    with pytest.raises(KilledError), transaction.atomic():
        assert finish_evaluation(**done)
        raise KilledError
    assert not Submission.objects.exists()
    assert finish_evaluation(**done) and not finish_evaluation(**done)
    assert Submission.objects.count() == 1


def test_a_run_without_a_result_submits_nothing(alice, now):
    own = ask(alice, now, race=a_race(now), submit_if_better=True)
    stop_evaluation(evaluation=own.evaluation, now=now)
    assert not Submission.objects.exists()


# --- the queue and the quota -----------------------------------------------------------------------------------------


def test_own_runs_wait_behind_what_races_wait_for_and_before_house_cars(alice, bob, now):
    own = ask(bob, now)
    house = a_racer("house", is_house=True)
    idle = submit_model(race=a_race(now), racer=house, model=a_model(house), now=now)
    sent = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now + timedelta(minutes=1))
    places = [queue_position(one.evaluation) for one in (sent, own, idle)]
    assert places == [1, 2, 3] and OWN < 0 < URGENT


def test_an_own_run_counts_in_no_race(alice, now):
    race = a_race(now, max_submissions=1)
    finish(ask(alice, now, race=race), laps(*[10_000] * 3), now)
    assert not Entry.objects.filter(race=race).exists()
    assert submit_model(race=race, racer=alice, model=a_model(alice), now=now)


def limit(racer, name, value):
    RacerQuota.objects.update_or_create(racer=racer, name=name, defaults={"limit": value})


def test_no_more_than_so_many_wait_at_a_time(alice, now):
    limit(alice, "own_runs_at_once", 1)
    own = ask(alice, now)
    refused("own_runs_at_once", ask, owner=alice, now=now)
    stop_evaluation(evaluation=own.evaluation, now=now)
    assert ask(alice, now)


def test_no_more_than_so_many_a_day_deleted_ones_too(alice, now):
    limit(alice, "own_runs_a_day", 1)
    own = finish(ask(alice, now), laps(10_000), now)
    delete_own(own=own, now=now)
    refused("own_runs_a_day", ask, owner=alice, now=now)
    assert ask(alice, now + timedelta(days=1))
    assert not OwnEvaluation.objects.filter(pk=own.pk).exists(), "what counts no more is forgotten"


def test_what_paddock_fails_and_what_never_began_does_not_count(alice, now):
    failed, stopped = ask(alice, now), ask(alice, now)
    break_down(failed.evaluation, PlatformFault("runner_died", how="killed"), now)
    stop_evaluation(evaluation=stopped.evaluation, now=now)
    assert used_by(alice, "own_runs_a_day", now) == 0
    driven = ask(alice, now)
    stop_evaluation(evaluation=start(driven.evaluation, now), now=now)
    assert used_by(alice, "own_runs_a_day", now) == 1
    delete_own(own=OwnEvaluation.objects.select_related("evaluation").get(pk=driven.pk), now=now)
    assert used_by(alice, "own_runs_a_day", now) == 1


def test_who_fills_the_disk_drives_no_more(alice, now):
    limit(alice, "storage_mb", 0)
    refused("storage_full", ask, owner=alice, now=now)


# --- who sees it and what they may do --------------------------------------------------------------------------------


def test_only_its_racer_and_admins_see_a_run_of_ones_own(alice, bob, charlie, now):
    admin = a_racer("admin", is_staff=True)
    race = create_community_race(
        organiser=charlie, now=now, name="Lunch", track=a_track(), opens_at=now, closes_at=now + timedelta(days=1)
    )
    rival = a_model(bob)
    share_model(model=rival, now=now)
    runs = [ask(alice, now, race=race), ask(alice, now, rivals=[rival], **HEAD)]
    for own in runs:
        for racer, sees in ((alice, True), (admin, True), (bob, False), (charlie, False), (None, False)):
            assert can_see_evaluation(racer, own.evaluation) is sees
            assert evaluations_visible_to(racer).filter(pk=own.evaluation_id).exists() is sees


def test_who_may_change_a_run_is_who_finds_it_in_their_list(alice, bob, now):
    own = ask(alice, now)
    for racer in (alice, bob, a_racer("admin", is_staff=True)):
        assert is_own_of(racer, own) is (racer == alice) is own_runs_of(racer).filter(pk=own.pk).exists()
    deleted = finish(own, laps(10_000), now)
    delete_own(own=deleted, now=now)
    deleted.refresh_from_db()
    assert not is_own_of(alice, deleted) and not own_runs_of(alice).exists()


def test_its_racer_stops_a_run_whoever_drives_along(alice, bob, now):
    rival = a_model(bob)
    share_model(model=rival, now=now)
    own = ask(alice, now, rivals=[rival], **HEAD)
    assert can_stop_run(alice, own.evaluation) and can_stop_run(a_racer(is_staff=True), own.evaluation)
    assert not can_stop_run(bob, own.evaluation)


def test_a_run_is_driven_again_as_it_was(alice, now):
    boxes = [{"fraction": 0.3, "lane": "inner"}]
    own = ask(alice, now, **BOXES, boxes=boxes, laps=2, start_m=1.5, ranking_method="best", minimum_laps=1)
    again = drive_own_again(own=own, now=now)
    assert again.evaluation.spec == own.evaluation.spec and again.evaluation != own.evaluation
    assert (again.ranking_method, again.minimum_laps) == ("best", 1)
    among = ask(alice, now, rivals=[a_model(alice)], **HEAD)
    assert drive_own_again(own=among, now=now).evaluation.rivals.count() == 1


def test_a_run_as_in_a_race_is_driven_again_by_the_rules_that_it_has_now(alice, now):
    race = a_race(now)
    own = ask(alice, now, race=race)
    race.laps = 5
    race.save()
    assert drive_own_again(own=own, now=now).rules.laps == 5


def test_a_run_of_a_car_that_has_left_is_not_driven_again(alice, now):
    own = ask(alice, now)
    delete_model(model=own.evaluation.model, now=now)
    own.evaluation.model.refresh_from_db()
    refused("own_model_gone", drive_own_again, own=own, now=now)
    assert OwnEvaluation.objects.count() == 1


def test_deleting_takes_result_and_files_along_and_leaves_what_was_sent(alice, now, commits):
    race = a_race(now)
    own = finish(ask(alice, now, race=race, submit_if_better=True), laps(*[10_000] * 3), now)
    trace, evaluation = own.evaluation.result.trace, own.evaluation
    storage, name = trace.storage, trace.name
    assert storage.exists(name)
    delete_own(own=own, now=now)
    assert not Evaluation.objects.filter(pk=evaluation.pk).exists() and not storage.exists(name)
    assert Submission.objects.filter(pk=own.submission_id).exists()


def test_a_run_that_waits_or_drives_is_not_deleted(alice, now):
    own = ask(alice, now)
    refused("own_under_way", delete_own, own=own, now=now)
    start(own.evaluation, now)
    refused("own_under_way", delete_own, own=own, now=now)
    assert Evaluation.objects.count() == 1


def test_an_option_that_no_run_has_is_a_mistake_of_ours(alice, now):
    with pytest.raises(TypeError):
        ask(alice, now, shared_cars=True)
    with pytest.raises(UserFault):
        ask(alice, now, laps=0)


def test_test_drives_of_before_become_own_runs(alice, now):
    own = ask(alice, now, laps=2)
    sent = submit_model(race=a_race(now), racer=alice, model=a_model(alice), now=now)
    OwnEvaluation.objects.all().delete()
    take_over = import_module("races.migrations.0004_own_runs_of_before").take_over
    for _ in range(2):
        take_over(apps, None)
    found = OwnEvaluation.objects.get()
    assert found.evaluation == own.evaluation != sent.evaluation
    assert (found.owner, found.minimum_laps, found.asked_at) == (alice, 2, own.evaluation.queued_at)


def test_a_race_that_its_racer_sees_no_more_is_not_named(alice, bob, now):
    race = a_race(now, visibility="invitation", organiser=bob)
    entry = Entry.objects.create(race=race, racer=alice)
    own = finish(ask(alice, now, race=race), laps(*[10_000] * 3), now)
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    Race.objects.filter(pk=race.pk).update(name="The secret cup")
    addresses = "/runs/", "/api/v1/evaluations/", f"/api/v1/evaluations/{own.evaluation.public_id}/"
    assert [b"The secret cup" in client.get(at).content for at in addresses] == [True] * 3
    Entry.objects.filter(pk=entry.pk).update(withdrawn_at=now, removed_at=now)
    assert [b"The secret cup" in client.get(at).content for at in addresses] == [False] * 3


def test_every_car_of_a_run_is_called_after_whose_it_is(alice, bob, now):
    theirs, mine = a_model(bob), a_model(alice)
    share_model(model=theirs, now=now)
    own = ask(alice, now, model=theirs, **HEAD, rivals=[mine])
    assert [(car.racer, car.label) for car in live_cars(own.evaluation)] == [(bob, "bob"), (alice, "alice")]
