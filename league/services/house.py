"""The house's own racers: the organiser of the demo races, and the cars that stand on boards as marks to beat.

A house car is two files of training/house_cars: NAME.onnx, and NAME.json, its model_metadata.json with what was noted
about it under ``house_car`` (``display_name``, ``description``). It goes the way of every upload: packages, gate,
sandbox, queue. Nothing about it is trusted or faked because it is ours.
"""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from datetime import datetime
from io import BytesIO
from pathlib import Path

from django.conf import settings
from django.db import transaction

from accounts.models import Racer
from evaluation.looks import Shell, VehicleLook
from evaluation.models import TrainedModel
from evaluation.services import describe_model, upload_model
from paddock.errors import PaddockError, UserFault
from paddock.packages.read import UploadPart, read_upload
from races.models import Race, RaceKind, Submission
from races.selectors import racing_now
from races.services import submit_model

logger = logging.getLogger(__name__)
HOUSE_CARS_DIR = Path(settings.BASE_DIR) / "training" / "house_cars"
ORGANISER = "Paddock"
# What the house's own cars wear, so that boards and replays tell them apart from racers' cars at once.
LOOKS = {
    "steady": VehicleLook(Shell.VAN, "#94a3b8"),
    "brisk": VehicleLook(Shell.HATCH, "#f59e0b"),
    "flyer": VehicleLook(Shell.FORMULA, "#ef4444"),
}
# An address that never receives anything (RFC 2606), and by which a house racer is found again.
_EMAIL = "{name}@house.invalid"


@dataclass(frozen=True)
class HouseCar:
    """One car of the folder. ``name``: of its files; ``display_name``: what racers see; ``look``: in replays."""

    name: str
    display_name: str
    description: str
    onnx: Path
    metadata: Path
    look: VehicleLook = VehicleLook()  # noqa: RUF009  a tuple


@dataclass(frozen=True)
class HouseReport:
    """How many house cars there are, and how many submissions were made for them now."""

    cars: int
    submitted: int


def house_cars(folder: Path = HOUSE_CARS_DIR) -> list[HouseCar]:
    """The cars of the folder in order of their names. One that cannot be read is logged and left out."""
    cars = []
    for onnx in sorted(folder.glob("*.onnx")):
        metadata = onnx.with_suffix(".json")
        try:
            noted = json.loads(metadata.read_text()).get("house_car", {})
        except (OSError, ValueError, AttributeError) as error:
            logger.warning("House car %s is left out: %s cannot be read (%s).", onnx.stem, metadata.name, error)
            continue
        name = str(noted.get("display_name") or onnx.stem)
        cars.append(
            HouseCar(
                onnx.stem, name, str(noted.get("description", "")), onnx, metadata, LOOKS.get(onnx.stem, VehicleLook())
            )
        )
    return cars


def house_racer(*, name: str, display_name: str, now: datetime) -> Racer:
    """The house's racer of this name, made on first use. Nobody can log in as one."""
    email = _EMAIL.format(name=name.lower())
    with transaction.atomic():
        racer = Racer.objects.filter(email=email, is_house=True).first()
        if racer is None:
            alias = _free_alias(display_name, f"house-{name}")
            racer = Racer.objects.create_user(alias, email, None, is_house=True, joined_at=now)
    return racer


def enter_house_cars(*, now: datetime, folder: Path = HOUSE_CARS_DIR) -> HouseReport:
    """Send every house car to every open race of the league and of the house in which it has not yet driven.

    Doing it again changes nothing. A car that is refused, and a host on which nothing may run, are logged; nobody's
    start fails because of them. An admin who deactivates a house racer keeps its car at home.
    """
    cars = house_cars(folder)
    if not cars:
        logger.info("There are no house cars in %s.", folder)
    races = [
        race
        for race in racing_now(now).filter(physical=False)
        if race.kind == RaceKind.LEAGUE or _is_of_the_house(race)
    ]
    submitted = 0
    for car in cars if races else ():
        racer = house_racer(name=car.name, display_name=car.display_name, now=now)
        if not racer.is_active:
            continue
        try:
            model = _model_of(car, racer, now)
        except PaddockError as fault:
            logger.warning("House car %s stays at home: %s (%s)", car.name, fault, fault.code)
            continue
        submitted += sum(_submit(race, racer, model, now) for race in races)
    return HouseReport(len(cars), submitted)


def _is_of_the_house(race: Race) -> bool:
    return race.organiser is not None and race.organiser.is_house


def _model_of(car: HouseCar, racer: Racer, now: datetime) -> TrainedModel:
    """The car in the garage of its racer, uploaded when it is not there: a retrained one is another model."""
    sha256 = read_upload(_files(car)).source_sha256
    known = TrainedModel.objects.filter(owner=racer, source_sha256=sha256, deleted_at=None).first()
    if known is not None:
        if known.look != car.look:
            describe_model(model=known, name=known.name, description=known.description, look=car.look)
        return known
    model = upload_model(owner=racer, files=_files(car), description=car.description, look=car.look, now=now)
    return model.model


def _files(car: HouseCar) -> list[UploadPart]:
    return [
        UploadPart(f"{car.display_name}.onnx", BytesIO(car.onnx.read_bytes())),
        UploadPart("model_metadata.json", BytesIO(car.metadata.read_bytes())),
    ]


def _submit(race: Race, racer: Racer, model: TrainedModel, now: datetime) -> bool:
    if Submission.objects.filter(entry__race=race, entry__racer=racer, network=model.network, is_void=False).exists():
        return False
    try:
        submit_model(race=race, racer=racer, model=model, now=now)
    except UserFault as fault:
        logger.info("House car %s is not in %s: %s", racer, race, fault.code)
        return False
    return True


def _free_alias(*wanted: str) -> str:
    for alias in (*wanted, *(f"{wanted[-1]}-{number}" for number in range(2, 100))):
        if not Racer.objects.filter(alias__iexact=alias).exists():
            return alias
    raise ValueError(f"no alias like {wanted} is free")
