"""The wizard starts from a house car that already drives, where one fits; otherwise from nothing."""

from __future__ import annotations

from typing import Any

import pytest
from django.test import Client

from evaluation.models import TrainedModel
from league.house_cars.services import enter_house_cars, house_racer
from tests.factories import a_race
from tests.pages.conftest import World
from tests.pages.test_training import form_of
from training.models import TrainingJob, Vehicle


@pytest.fixture
def steady(world: World, wakes, trainings_taken_on) -> TrainedModel:
    """Steady, beside the other house cars of a new site."""
    a_race(world.now, organiser=house_racer(name="paddock", display_name="Paddock", now=world.now))
    enter_house_cars(now=world.now)
    return TrainedModel.objects.get(owner__is_house=True, name="Steady")


def train(client: Client, **changes: Any) -> TrainingJob:
    """The training that the wizard makes of its proposals with changes."""
    response = client.post("/train/new/", form_of(client, **changes))
    assert response.status_code == 302, response.context["form"].errors
    return TrainingJob.objects.get(name="New-one")


def test_a_training_starts_from_the_house_car_unless_asked_otherwise(world: World, steady: TrainedModel) -> None:
    job = train(world.client("newcomer"))
    assert job.cloned_from == steady


def test_from_nothing_is_one_choice_away(world: World, steady: TrainedModel) -> None:
    assert train(world.client("newcomer"), start="nothing", clone=steady.public_id).cloned_from is None


def test_ranges_start_from_the_house_car_of_ranges(world: World, steady: TrainedModel) -> None:
    assert train(world.client("newcomer"), action_space_type="continuous").cloned_from.name == "Flyer"


UNFIT = {
    "SAC": {"algorithm": "sac", "action_space_type": "continuous", "num_epochs": "6"},
    "a sixth action": {"actions-6-steering": "20", "actions-6-speed": "1"},
    "left and right exchanged": {"actions-1-steering": "30", "actions-5-steering": "-30"},
}


@pytest.mark.parametrize("change", UNFIT)
def test_what_the_house_car_does_not_fit_starts_from_nothing(world: World, steady: TrainedModel, change: str) -> None:
    assert train(world.client("newcomer"), **UNFIT[change]).cloned_from is None


def test_another_vehicle_starts_from_nothing(world: World, steady: TrainedModel) -> None:
    vehicle = Vehicle.objects.create(owner=world.newcomer, name="Owl", sensors=["STEREO_CAMERAS"])
    assert train(world.client("newcomer"), vehicle=vehicle.public_id).cloned_from is None


@pytest.mark.parametrize("asked", ["lesson=reward", "example=waypoints", "recipe=all-round"])
def test_what_is_there_to_be_learned_is_learned_from_nothing(world: World, steady: TrainedModel, asked: str) -> None:
    assert world.client("newcomer").get(f"/train/new/?{asked}").context["form"]["start"].value() == "nothing"


def test_a_named_model_is_the_start(world: World, steady: TrainedModel) -> None:
    form = world.client("alice").get("/train/new/", {"clone": steady.public_id}).context["form"]
    assert (form["start"].value(), form["clone"].value()) == ("model", steady.public_id)


def test_another_model_must_be_named(world: World, steady: TrainedModel) -> None:
    client = world.client("newcomer")
    response = client.post("/train/new/", form_of(client, start="model", clone=""))
    assert response.status_code == 422
    assert response.context["form"].errors == {"clone": ["Choose a model, or start from nothing."]}


def test_a_site_without_house_cars_offers_none(world: World) -> None:
    response = world.client("newcomer").get("/train/new/")
    form = response.context["form"]
    assert form["start"].value() == "nothing" and "house" not in dict(form.fields["start"].choices)
    assert "house car" not in response.content.decode().partition('id="what"')[2].partition('id="where"')[0]


def test_a_form_without_the_choice_still_names_a_model(world: World, steady: TrainedModel) -> None:
    client = world.client("newcomer")
    sent = form_of(client, clone=steady.public_id)
    del sent["start"]
    assert client.post("/train/new/", sent).status_code == 302
    assert TrainingJob.objects.get(name="New-one").cloned_from == steady
