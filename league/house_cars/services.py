"""House cars and their racers: baselines on boards, and the organiser of the demo races."""

import json
import logging
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from io import BytesIO
from pathlib import Path

from django.conf import settings
from django.db import IntegrityError, transaction
from django.db.models import Q

from accounts.models import Racer
from evaluation.appearance.looks import Shell, VehicleLook
from evaluation.garage.admission import AdmittedPackage
from evaluation.garage.services import describe_model, upload_model
from evaluation.models import TrainedModel
from paddock.errors import PaddockError, UserFault
from paddock.network.bound import NetworkFacts
from paddock.packages.metadata import identity, parse_metadata
from paddock.packages.read import RawPackage, UploadPart, read_upload
from paddock.simulator.engine import ENGINE_ID
from races.entries.selectors.lists import racing_now
from races.entries.services.submissions import submit_model
from races.models import Race, RaceKind, Submission

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
    look: VehicleLook


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
        name, description = str(noted.get("display_name") or onnx.stem), str(noted.get("description", ""))
        look = LOOKS.get(onnx.stem, VehicleLook())
        cars.append(HouseCar(onnx.stem, name, description, onnx, metadata, look))
    return cars


def house_racer(*, name: str, display_name: str, now: datetime) -> Racer:
    """The house's racer of this name, made on first use. Nobody can log in as one."""
    email = _EMAIL.format(name=name.lower())
    known = Racer.objects.filter(email=email, is_house=True)
    racer = known.first()
    if racer is None:
        alias = _free_alias(display_name, f"house-{name}")
        try:
            with transaction.atomic():
                racer = Racer.objects.create_user(alias, email, None, is_house=True, joined_at=now)
        except IntegrityError:  # another worker created the racer at this moment
            racer = known.get()
    return racer


def enter_house_cars(*, now: datetime, folder: Path = HOUSE_CARS_DIR) -> int:
    """Submit every house car to each open race of the league and the house that lacks it; returns the number submitted.

    Refused cars and hosts that cannot run cars are logged. Cars of deactivated house racers are left out.
    """
    cars = house_cars(folder)
    if not cars:
        logger.info("There are no house cars in %s.", folder)
    of_the_house = Q(kind=RaceKind.LEAGUE) | Q(organiser__is_house=True)
    races = list(racing_now(now).filter(of_the_house, physical=False))
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
    return submitted


def _model_of(car: HouseCar, racer: Racer, now: datetime) -> TrainedModel:
    """The car in the garage of its racer, uploaded when it is not there: a retrained one is another model."""
    package = read_upload(_files(car))
    known = TrainedModel.objects.filter(owner=racer, source_sha256=package.source_sha256, deleted_at=None).first()
    if known is not None:
        if known.look != car.look:
            describe_model(model=known, name=known.name, description=known.description, look=car.look)
        return known
    admitted = _recorded_admission(car, package)
    upload = partial(upload_model, admitted=admitted) if admitted else upload_model
    return upload(owner=racer, files=_files(car), description=car.description, look=car.look, now=now).model


def _recorded_admission(car: HouseCar, package: RawPackage) -> AdmittedPackage | None:
    """What the admission of these very files found; None where a file, the canonical network or the engine differs."""
    recorded = car.onnx.parent / "admitted" / car.onnx.name
    try:
        onnx, found = recorded.read_bytes(), json.loads(recorded.with_suffix(".json").read_text())
    except (OSError, ValueError):
        return None
    if (found["engine"], found["source_sha256"]) != (ENGINE_ID, package.source_sha256):
        return None
    metadata = parse_metadata(package.metadata_json)
    if identity(onnx, metadata) != found["sha256"]:
        return None
    return AdmittedPackage(
        onnx=onnx,
        sha256=found["sha256"],
        metadata=metadata,
        source_kind=package.kind,
        source_sha256=package.source_sha256,
        parameters=found["parameters"],
        macs=found["macs"],
        facts=NetworkFacts.from_dict(found["facts"]),
    )


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
