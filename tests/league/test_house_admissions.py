"""A site takes a house car's recorded admission for the very network, metadata and engine; the sandbox decides else."""

from __future__ import annotations

import json
import shutil
from datetime import datetime
from pathlib import Path

import pytest

from evaluation.garage import admission as admit
from evaluation.models import TrainedModel
from league.house_cars import services as house
from league.house_cars.services import HOUSE_CARS_DIR, HouseCar, house_cars, house_racer
from paddock.simulator.engine import ENGINE_ID

pytestmark = pytest.mark.django_db


class SandboxAsked(Exception):
    """The car was to be admitted like any upload."""


@pytest.fixture
def no_sandbox(monkeypatch) -> None:
    def asked(*args: object, **kwargs: object) -> None:
        raise SandboxAsked

    monkeypatch.setattr(admit, "launch", asked)


@pytest.fixture
def copied(tmp_path) -> Path:
    """The folder of the house cars, to be changed."""
    folder = tmp_path / "cars"
    for part in (".", "admitted"):
        (folder / part).mkdir(parents=True, exist_ok=True)
        for suffix in (".onnx", ".json"):
            shutil.copy(HOUSE_CARS_DIR / part / f"steady{suffix}", folder / part)
    return folder


def uploaded(car: HouseCar, now: datetime) -> TrainedModel:
    racer = house_racer(name=car.name, display_name=car.display_name, now=now)
    return house._model_of(car, racer, now)


def test_committed_cars_need_no_sandbox(no_sandbox, now):
    cars = house_cars()
    for car in cars:
        model = uploaded(car, now)
        found = json.loads((HOUSE_CARS_DIR / "admitted" / f"{car.name}.json").read_text())
        network = model.network
        with network.onnx.open() as stored:
            assert stored.read() == (HOUSE_CARS_DIR / "admitted" / f"{car.name}.onnx").read_bytes()
        assert {
            name: getattr(network, name) for name in ("sha256", "facts", "parameters", "macs")
        }.items() <= found.items()
        assert model.metadata["sensor"] == ["FRONT_FACING_CAMERA"]
        assert uploaded(car, now) == model
    assert TrainedModel.objects.count() == len(cars) == 3


def other_actions(folder: Path) -> None:
    file = folder / "steady.json"
    file.write_text(file.read_text().replace('"speed": 1.1', '"speed": 1.2'))


def other_network(folder: Path) -> None:
    flip(folder / "steady.onnx")


def other_canonical_network(folder: Path) -> None:
    flip(folder / "admitted/steady.onnx")


def other_engine(folder: Path) -> None:
    file = folder / "admitted/steady.json"
    file.write_text(file.read_text().replace(ENGINE_ID, "paddock-v0"))


def not_recorded(folder: Path) -> None:
    shutil.rmtree(folder / "admitted")


def cut_off(folder: Path) -> None:
    (folder / "admitted/steady.json").write_text('{"engine"')


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[-100] ^= 1
    file.write_bytes(content)


@pytest.mark.parametrize(
    "change", [other_actions, other_network, other_canonical_network, other_engine, not_recorded, cut_off]
)
def test_another_car_is_admitted_by_the_sandbox(change, copied, no_sandbox, now):
    change(copied)
    (car,) = house_cars(copied)
    with pytest.raises(SandboxAsked):
        uploaded(car, now)


def test_a_copy_of_the_cars_needs_no_sandbox(copied, no_sandbox, now):
    (car,) = house_cars(copied)
    assert uploaded(car, now).network.parameters == 202_437
