"""Cars that the site makes by itself wear what they should: those of trainings and those of the house."""

from __future__ import annotations

from pathlib import Path

import pytest
from django.utils import timezone

from evaluation.appearance.looks import VehicleLook
from evaluation.models import TrainedModel
from league.house_cars.services import LOOKS, _model_of, house_cars, house_racer
from tests.factories import a_racer, a_track
from tests.training.jobs import a_training
from training.jobs.services.results import admit_networks
from training.models import TrainingJob

pytestmark = pytest.mark.django_db(transaction=True)
HOUSE_CARS = Path(__file__).resolve().parents[2] / "training" / "house_cars"


def test_trained_models_get_the_look_of_their_vehicle(settings):
    settings.TRAINING, settings.TRAINING_PAUSED = True, False
    now = timezone.now()
    job = a_training(a_racer("alice"), a_track(), now)
    TrainingJob.objects.filter(pk=job.pk).update(shell="buggy", colour="#aa00ff")
    job.refresh_from_db()
    networks = [(HOUSE_CARS / f"{name}.onnx").read_bytes() for name in ("steady", "steady")]
    models = admit_networks(job=job, best=networks[0], last=networks[1], now=now)
    assert {model.look for model in models} == {VehicleLook("buggy", "#aa00ff")}


def test_each_house_car_gets_its_own_look():
    now = timezone.now()
    cars = house_cars()
    assert {car.name: car.look for car in cars} == LOOKS and len(set(LOOKS.values())) == 3
    steady = next(car for car in cars if car.name == "steady")
    racer = house_racer(name="steady", display_name="Steady", now=now)
    model = _model_of(steady, racer, now)
    assert model.look == LOOKS["steady"]
    TrainedModel.objects.update(shell="paddock", colour="#3b82f6")
    assert _model_of(steady, racer, now).pk == model.pk
    model.refresh_from_db()
    assert model.look == LOOKS["steady"]
