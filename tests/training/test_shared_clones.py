"""Training on from the weights of somebody else's shared model."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.db.models import ProtectedError

from evaluation.garage.services import delete_model, purge_garages, share_model, stop_sharing_model
from evaluation.models import Network, TrainedModel
from evaluation.selectors import can_see_model, visible_models
from paddock.errors import UserFault
from races.entries.services.submissions import submit_model
from tests.factories import a_race
from tests.rows import METADATA, model_row
from tests.training.jobs import a_training
from training.jobs.selectors import can_see_training
from training.jobs.services.worker import spec_of
from training.models import JobState, TrainingJob, Vehicle
from training.trainer.network import CONSOLE, NetworkLayout
from training.wizard.fields import OWN_LISTED, SHARED_LISTED
from training.wizard.forms import TrainingForm
from training.wizard.prefill import LACKS_VEHICLE, proposals

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes", "wakes")]

SPACE = [{key: action[key] for key in ("steering_angle", "speed")} for action in METADATA["action_space"]]


def trained_here(owner, name: str = "Bolt", onnx: bytes = b"a network") -> TrainedModel:
    """A model with as many weights as a training here makes."""
    model = model_row(owner, name, onnx)
    Network.objects.filter(pk=model.network_id).update(parameters=NetworkLayout.of(METADATA).parameters)
    model.refresh_from_db()
    return model


@pytest.fixture
def shared(bob, now) -> TrainedModel:
    """Bob's, shared."""
    model = trained_here(bob)
    share_model(model=model, now=now)
    return model


def test_a_clone_of_a_shared_model_belongs_to_its_racer(alice, shared, oval, now):
    job = a_training(alice, oval, now, clone_from=shared, action_space=SPACE)
    assert (job.owner, job.cloned_from, job.state) == (alice, shared, JobState.QUEUED)
    assert spec_of(job).build == "paddock"


def test_whoever_sees_a_model_may_clone_it(alice, bob, shared, now):
    everybody = (alice, bob, AnonymousUser())
    for expected in ({alice, bob}, {bob}):
        for racer in everybody:
            may = can_see_model(racer, shared)
            assert may == (shared in visible_models(racer)) == (racer in expected)
        stop_sharing_model(model=shared)


def test_a_model_no_longer_shared_cannot_be_cloned(alice, shared, oval, now):
    stop_sharing_model(model=shared)
    with pytest.raises(UserFault) as refused:
        a_training(alice, oval, now, clone_from=shared, action_space=SPACE)
    assert refused.value.code == "clone_not_yours"


@pytest.mark.parametrize("end", ["stop_sharing", "delete"])
def test_a_training_outlasts_the_sharing_of_its_model(alice, shared, oval, now, end):
    job = a_training(alice, oval, now, clone_from=shared, action_space=SPACE)
    if end == "delete":
        delete_model(model=shared, now=now)
    else:
        stop_sharing_model(model=shared)
    Network.objects.update(created_at=now - timedelta(days=9))
    purge_garages(now=now + timedelta(days=9))
    job = TrainingJob.objects.get(pk=job.pk)
    assert job.cloned_from == shared
    with job.cloned_from.network.onnx.open("rb") as file:
        assert file.read() == b"a network", "the trainer may still have to begin with it"


def test_a_racer_whose_model_was_cloned_cannot_be_removed(alice, bob, shared, oval, now):
    job = a_training(alice, oval, now, clone_from=shared, action_space=SPACE)
    with pytest.raises(ProtectedError), transaction.atomic():
        bob.delete()
    assert TrainingJob.objects.get(pk=job.pk).cloned_from == shared


def test_training_and_reward_function_are_not_shared(alice, bob, shared, oval, now):
    job = a_training(bob, oval, now)
    TrainingJob.objects.filter(pk=job.pk).update(best_model=shared)
    assert not can_see_training(alice, job)
    assert "reward_code" not in {
        k for k, v in proposals(alice, {"clone": shared.public_id}).items() if v == job.reward_code
    }


def test_only_its_owner_may_submit_a_shared_model(alice, shared, now):
    with pytest.raises(UserFault) as refused:
        submit_model(race=a_race(now), racer=alice, model=shared, now=now)
    assert refused.value.code == "model_not_yours"


class TestModelChoice:
    def groups(self, racer, now, chosen=None) -> dict[str, list[str]]:
        return self.groups_of(TrainingForm(owner=racer, now=now, initial={"clone": chosen}))

    def groups_of(self, form: TrainingForm) -> dict[str, list[str]]:
        return {name: [label for _, label in rows] for name, rows in form.fields["clone"].choices if name}

    def test_it_lists_own_and_shared_models_in_groups(self, alice, shared, now):
        assert self.groups(alice, now) == {"Shared models": ["Bolt (bob)"]}
        model_row(alice, "Mine", b"mine")
        assert self.groups(alice, now) == {"My models": ["Mine"], "Shared models": ["Bolt (bob)"]}

    def test_it_lists_an_owner_once(self, bob, shared, now):
        assert self.groups(bob, now) == {"My models": ["Bolt"]}

    def test_it_is_bounded_and_keeps_the_chosen_model(self, alice, bob, shared, now, django_assert_max_num_queries):
        for number in range(SHARED_LISTED + 5):
            later = model_row(bob, f"Car {number}", str(number).encode())
            share_model(model=later, now=now + timedelta(minutes=number + 1))
        form = TrainingForm(owner=alice, now=now, initial={"clone": shared.public_id})
        with django_assert_max_num_queries(3):
            listed = self.groups_of(form)["Shared models"]
        assert len(listed) == SHARED_LISTED + 1
        assert listed[-1] == "Bolt (bob)", "the oldest one is chosen"
        assert OWN_LISTED + SHARED_LISTED < 200

    def test_it_accepts_a_clonable_model_that_is_not_listed(self, alice, bob, shared, now):
        field = TrainingForm(owner=alice, now=now).fields["clone"]
        for number in range(SHARED_LISTED + 1):
            share_model(model=model_row(bob, f"Car {number}", str(number).encode()), now=now + timedelta(minutes=1))
        assert field.clean(shared.public_id) == shared

    @pytest.mark.parametrize("sent", ["x" * 12, "\x00", "\ud800"])
    def test_it_refuses_an_unknown_model(self, alice, shared, now, sent):
        from django.core.exceptions import ValidationError

        with pytest.raises(ValidationError):
            TrainingForm(owner=alice, now=now).fields["clone"].clean(sent)


def test_a_console_car_gets_the_consoles_learning_rate(alice, shared, oval, now):
    clone = {"clone": shared.public_id}
    assert proposals(alice, clone)["lr"] == 0.001
    Network.objects.filter(pk=shared.network_id).update(parameters=NetworkLayout.of(METADATA, CONSOLE).parameters)
    assert proposals(alice, clone)["lr"] == 0.0003
    job = a_training(alice, oval, now, hyperparameters={"lr": 0.0007})
    assert proposals(alice, clone | {"job": job.public_id})["lr"] == 0.0007


class TestVehicleForClone:
    @pytest.fixture
    def deep(self, shared):
        """The same model with five layers, which the original car has not."""
        metadata = METADATA | {"neural_network": "DEEP_CONVOLUTIONAL_NETWORK_DEEP"}
        TrainedModel.objects.filter(pk=shared.pk).update(metadata=metadata)
        return shared

    def test_the_original_car_is_chosen_when_it_fits(self, alice, shared):
        Vehicle.objects.create(owner=alice, name="A")
        initial = proposals(alice, {"clone": shared.public_id})
        assert initial["vehicle"] == "" and LACKS_VEHICLE not in initial

    def test_a_fitting_vehicle_is_chosen(self, alice, deep):
        Vehicle.objects.create(owner=alice, name="A")
        fits = Vehicle.objects.create(owner=alice, name="B", neural_network="DEEP_CONVOLUTIONAL_NETWORK_DEEP")
        initial = proposals(alice, {"clone": deep.public_id})
        assert initial["vehicle"] == fits.public_id
        assert LACKS_VEHICLE not in initial

    def test_a_vehicle_is_asked_for_when_none_fits(self, alice, deep):
        Vehicle.objects.create(owner=alice, name="A")
        assert proposals(alice, {"clone": deep.public_id})[LACKS_VEHICLE] == deep

    def test_the_usual_car_needs_no_vehicle(self, alice, shared):
        assert LACKS_VEHICLE not in proposals(alice, {"clone": shared.public_id})

    def test_a_vehicle_with_another_lidar_does_not_fit(self, alice, bob, shared):
        metadata = METADATA | {"sensor": ["FRONT_FACING_CAMERA", "DISCRETIZED_SECTOR_LIDAR"]}
        metadata |= {"lidar_config": {"num_sectors": 4, "num_values_per_sector": 2, "clipping_dist": 2.0}}
        TrainedModel.objects.filter(pk=shared.pk).update(metadata=metadata)
        Vehicle.objects.create(owner=alice, name="A", sensors=metadata["sensor"])
        assert LACKS_VEHICLE in proposals(alice, {"clone": shared.public_id})
        Vehicle.objects.create(owner=alice, name="B", sensors=metadata["sensor"], lidar_config=metadata["lidar_config"])
        assert LACKS_VEHICLE not in proposals(alice, {"clone": shared.public_id})
