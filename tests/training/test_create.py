"""What is refused before a training begins, and with which words."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction

from evaluation.models import Network
from evaluation.selectors import can_see_model, visible_models
from paddock.errors import PaddockError, UserFault
from races.pages.services import edit_race
from tests.factories import a_race
from tests.rows import METADATA, model_row, track_row
from tests.training.jobs import a_training
from training.cloning.selectors import build_of_model
from training.jobs.selectors import minutes_left, minutes_used
from training.models import JobState, TrainingJob, Vehicle
from training.trainer.network import NetworkLayout

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes")]


def refusal(*arguments, **changes) -> PaddockError:
    with pytest.raises(PaddockError) as refused:
        a_training(*arguments, **changes)
    assert "%(" not in str(refused.value)
    assert not TrainingJob.objects.exclude(name="before").exists()
    return refused.value


def test_a_training_with_the_defaults_waits_and_sends_a_wake_up(
    alice, oval, now, training_wakes, django_capture_on_commit_callbacks
):
    with django_capture_on_commit_callbacks(execute=True):
        job = a_training(alice, oval, now)
    assert job.state == JobState.QUEUED
    assert job.sensors == ["FRONT_FACING_CAMERA"]
    assert job.hyperparameters["batch_size"] == 64
    assert [wake["queue"] for wake in training_wakes] == ["training"]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"name": "with blank"}, "training_name_form"),
        ({"name": "é"}, "training_name_form"),
        ({"name": "x" * 65}, "training_name_form"),
        ({"name": ""}, "training_name_form"),
        ({"name": "x\n"}, "training_name_form"),
        ({"description": "x" * 256}, "description_too_long"),
        ({"reward_code": "  \n"}, "training_reward_missing"),
        ({"algorithm": "dqn"}, "training_algorithm"),
        ({"algorithm": "sac"}, "training_sac_continuous"),
        ({"hyperparameters": {"batch_size": 31}}, "training_hyperparameter"),
        ({"hyperparameters": {"batch_size": 64.5}}, "training_hyperparameter"),
        ({"hyperparameters": {"num_epochs": 11}}, "training_hyperparameter"),
        ({"hyperparameters": {"lr": 0.0011}}, "training_hyperparameter"),
        ({"hyperparameters": {"lr": float("nan")}}, "training_hyperparameter"),
        ({"hyperparameters": {"lr": 10**400}}, "training_hyperparameter"),
        ({"hyperparameters": {"lr": True}}, "training_hyperparameter"),
        ({"hyperparameters": {"beta_entropy": -0.1}}, "training_hyperparameter"),
        ({"hyperparameters": {"discount_factor": 1.1}}, "training_hyperparameter"),
        ({"hyperparameters": {"num_episodes_between_training": 101}}, "training_hyperparameter"),
        ({"hyperparameters": {"loss_type": "l1"}}, "training_loss_type"),
        ({"hyperparameters": {"sac_alpha": 0.2}}, "training_hyperparameter_unknown"),
        ({"hyperparameters": {"exploration_type": "categorical"}}, "training_exploration"),
        ({"action_space_type": "both"}, "training_action_space"),
        ({"action_space": "left"}, "training_action_space"),
        ({"action_space": [1, 2]}, "training_action_space"),
        ({"action_space": [{"steering_angle": 0, "speed": 1}]}, "training_action_count"),
        ({"action_space": [{"steering_angle": 0, "speed": 1}] * 31}, "training_action_count"),
        ({"action_space": [{"steering_angle": 31, "speed": 1}] * 2}, "training_action_value"),
        ({"action_space": [{"steering_angle": 0, "speed": 0.05}] * 2}, "training_action_value"),
        ({"action_space": [{"steering_angle": 0}] * 2}, "training_action_value"),
        (
            {
                "action_space_type": "continuous",
                "action_space": {"steering_angle": {"low": 10, "high": 10}, "speed": {"low": 1, "high": 2}},
            },
            "training_action_bounds",
        ),
        ({"action_space_type": "continuous", "action_space": {"speed": {}}}, "training_action_space"),
        ({"stop_minutes": 0}, "training_minutes"),
        ({"stop_minutes": 1441}, "training_minutes"),
        ({"stop_steps": 0}, "training_steps"),
        ({"stop_clean_laps": 11}, "training_clean_laps"),
        ({"trials": 0}, "training_trials"),
        ({"best_metric": "style"}, "training_best_metric"),
        ({"seed": -1}, "training_seed"),
        ({"race_type": "object_avoidance"}, "training_course"),
        ({"race_type": "head_to_head"}, "training_course"),
        ({"bots": 2}, "training_course"),
        ({"race_type": "object_avoidance", "random_boxes": 11}, "training_course"),
        ({"race_type": "object_avoidance", "boxes": [{"fraction": 0.0, "lane": "inner"}]}, "box_on_start_line"),
    ],
)
def test_invalid_settings_are_refused(alice, oval, now, changes, code):
    assert refusal(alice, oval, now, **changes).code == code


def test_values_at_the_bounds_are_allowed(alice, oval, now, settings):
    settings.TRAININGS_AT_ONCE = 3
    low = {"batch_size": 32, "num_epochs": 3, "lr": 1e-8, "beta_entropy": 0, "discount_factor": 0}
    high = {"batch_size": 512, "num_epochs": 10, "lr": 1e-3, "beta_entropy": 1, "discount_factor": 1}
    a_training(alice, oval, now, name="low", hyperparameters=low | {"num_episodes_between_training": 5})
    a_training(alice, oval, now, name="high", hyperparameters=high | {"num_episodes_between_training": 100})


def test_models_and_running_trainings_hold_their_names(alice, bob, oval, now):
    model_row(alice, name="bolt")
    assert refusal(alice, oval, now, name="bolt").code == "training_name_taken"
    a_training(alice, oval, now, name="before")
    assert refusal(alice, oval, now, name="before").code == "training_name_taken"
    a_training(bob, oval, now, name="bolt")  # another's garage


def test_bots_are_not_trained_against_on_an_open_track(alice, now):
    straight = track_row("straight-track")
    assert refusal(alice, straight, now, race_type="head_to_head", bots=2).code == "track_needs_loop"


def test_a_full_garage_is_refused_before_training(alice, oval, now, settings):
    settings.MODELS_PER_RACER = 1
    model_row(alice)
    assert refusal(alice, oval, now).code == "garage_full"


def test_trainings_at_once_are_limited(alice, bob, oval, now, settings):
    settings.TRAININGS_AT_ONCE = 1
    job = a_training(alice, oval, now, name="before")
    assert refusal(alice, oval, now).code == "training_jobs_at_once"
    a_training(bob, oval, now, name="before")
    TrainingJob.objects.filter(pk=job.pk).update(state=JobState.STOPPED, ended_because="stopped", ended_at=now)
    a_training(alice, oval, now)


def test_past_and_pending_trainings_use_up_the_months_minutes(alice, oval, now, settings):
    settings.TRAINING_MINUTES_A_MONTH = 30
    job = a_training(alice, oval, now, name="before", stop_minutes=20)
    fault = refusal(alice, oval, now, stop_minutes=11)
    assert (fault.code, fault.params["left"]) == ("training_minutes_left", 10)
    TrainingJob.objects.filter(pk=job.pk).update(
        state=JobState.STOPPED, ended_because="stopped", ended_at=now, charged_s=120.0
    )
    assert minutes_used(alice, now) == 2.0
    assert minutes_left(alice, now + timedelta(days=31)) == 30.0


def test_platform_faults_cost_no_minutes(alice, oval, now):
    job = a_training(alice, oval, now)
    TrainingJob.objects.filter(pk=job.pk).update(
        state=JobState.FAILED, ended_because="failed", ended_at=now, charged_s=600.0, reason_code="training_gave_up"
    )
    assert minutes_used(alice, now) == 0.0
    TrainingJob.objects.filter(pk=job.pk).update(reason_code="reward_raised")
    assert minutes_used(alice, now) == 10.0


def test_a_site_without_training_says_what_to_install(alice, oval, now, settings):
    settings.TRAINING = False
    fault = refusal(alice, oval, now)
    assert fault.code == "training_unavailable"
    assert "make training" in str(fault)


def test_a_paused_queue_refuses_a_training(alice, oval, now, settings):
    settings.TRAINING_PAUSED = True
    assert refusal(alice, oval, now).code == "training_paused"


def test_somebody_elses_vehicle_is_refused(alice, bob, oval, now):
    vehicle = Vehicle.objects.create(owner=bob, name="Bob's")
    assert refusal(alice, oval, now, vehicle=vehicle).code == "vehicle_not_yours"


def test_a_race_whose_terms_nobody_has_accepted_is_refused_at_once(alice, oval, now):
    race = edit_race(race=a_race(now, track=oval), now=now, terms="Be kind.")
    assert refusal(alice, oval, now, submit_to_race=race).code == "race_terms"


def test_a_race_that_would_refuse_the_model_is_refused_at_once(alice, oval, now, monkeypatch):
    closed = a_race(now, opens_at=now - timedelta(days=3), closes_at=now)
    assert refusal(alice, oval, now, submit_to_race=closed).code == "race_closed"
    stereo = a_race(now, sensors=["STEREO_CAMERAS"])
    fault = refusal(alice, oval, now, submit_to_race=stereo)
    assert (fault.code, fault.params["needed"]) == ("sensors_not_offered", "FRONT_FACING_CAMERA")

    def check(race, racer, when):
        raise UserFault("race_needs_invitation")

    monkeypatch.setattr("races.entries.eligibility.CHECKS", [check])
    assert refusal(alice, oval, now, submit_to_race=a_race(now)).code == "race_needs_invitation"


def test_a_training_copies_its_vehicle(alice, oval, now):
    vehicle = Vehicle.objects.create(
        owner=alice, name="Two eyes", sensors=["STEREO_CAMERAS", "LIDAR"], shell="kart", colour="#ff0000"
    )
    job = a_training(alice, oval, now, vehicle=vehicle)
    vehicle.delete()
    job.refresh_from_db()
    assert (job.vehicle, job.sensors, job.shell) == (None, ["STEREO_CAMERAS", "LIDAR"], "kart")
    assert job.metadata["sensor"] == ["STEREO_CAMERAS", "LIDAR"]


class TestClones:
    def test_another_racers_model_is_refused(self, alice, bob, oval, now):
        model = model_row(bob)
        assert refusal(alice, oval, now, clone_from=model).code == "clone_not_yours"
        assert not can_see_model(alice, model)
        assert model not in visible_models(alice)

    def test_a_house_car_may_be_cloned(self, alice, bob):
        model = model_row(bob)
        type(bob).objects.filter(pk=bob.pk).update(is_house=True)
        model.refresh_from_db()
        assert can_see_model(alice, model)
        assert model in visible_models(alice)

    def test_other_sensors_are_refused(self, alice, oval, now):
        vehicle = Vehicle.objects.create(owner=alice, name="L", sensors=["FRONT_FACING_CAMERA", "LIDAR"])
        model = model_row(alice)
        assert refusal(alice, oval, now, clone_from=model, vehicle=vehicle).code == "clone_sensors"

    def test_another_network_is_refused(self, alice, oval, now):
        vehicle = Vehicle.objects.create(owner=alice, name="D", neural_network="DEEP_CONVOLUTIONAL_NETWORK_DEEP")
        model = model_row(alice)
        assert refusal(alice, oval, now, clone_from=model, vehicle=vehicle).code == "clone_network"

    def test_another_number_of_actions_is_refused(self, alice, oval, now):
        fault = refusal(alice, oval, now, clone_from=model_row(alice))
        assert fault.code == "clone_actions"
        assert fault.params["has"] == "3 discrete"

    def test_a_network_that_reads_several_observations_is_refused(self, alice, oval, now):
        model = model_row(alice)
        space = [dict(steering_angle=a["steering_angle"], speed=2.0) for a in METADATA["action_space"]]
        Network.objects.filter(pk=model.network_id).update(parameters=NetworkLayout.of(METADATA).parameters)
        model.metadata = {**METADATA, "frame_stack": 4}
        model.save()
        model.refresh_from_db()
        fault = refusal(alice, oval, now, clone_from=model, action_space=space)
        assert (fault.code, fault.params) == ("clone_frame_stack", {"count": 4})
        assert build_of_model(model) is None, "no page offers it"

    def test_a_network_not_built_here_is_refused(self, alice, oval, now):
        model = model_row(alice)
        space = [dict(steering_angle=a["steering_angle"], speed=2.0) for a in METADATA["action_space"]]
        assert refusal(alice, oval, now, clone_from=model, action_space=space).code == "clone_not_ours"


class TestTheDatabase:
    @pytest.mark.parametrize(
        "changes",
        [
            {"state": "running"},
            {"state": "finished"},
            {"state": "failed"},
            {"name": "with blank"},
            {"algorithm": "sac"},
            {"stop_minutes": 0},
            {"stop_clean_laps": 0},
            {"trials": 11},
            {"bots": 1},
            {"race_type": "object_avoidance"},
            {"bot_speed_mps": 9.0},
            {"best_metric": "style"},
            {"reward_code": ""},
        ],
    )
    def test_a_contradictory_row_is_refused(self, alice, oval, now, changes):
        job = a_training(alice, oval, now)
        with pytest.raises(IntegrityError), transaction.atomic():
            TrainingJob.objects.filter(pk=job.pk).update(**changes)
