"""The models that are measured: the console's network where the shared material is there, and every house car."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

from evaluation.garage.admission import admit
from paddock.network.bound import FactsDocument
from paddock.packages.metadata import MetadataDocument
from paddock.packages.read import UploadPart

CHECKOUT = Path(__file__).resolve().parent.parent
CONSOLE_CAR = CHECKOUT.parent / "shared" / "models" / "deepracer-console-15.tar.gz"
HOUSE_CARS = CHECKOUT / "training" / "house_cars"
CONSOLE = "console"


@dataclass(frozen=True)
class Car:
    """A car and its package as it would be uploaded: pairs of file name and bytes."""

    name: str
    files: tuple[tuple[str, bytes], ...]


@dataclass(frozen=True)
class AdmittedCar:
    """A car that passed the gate, with what the gate found out, which a run is told."""

    name: str
    onnx: bytes
    metadata: MetadataDocument
    facts: FactsDocument
    parameters: int
    macs: int


def cars() -> list[Car]:
    """The console's car first, if it is there, then the house cars by name."""
    found = []
    if CONSOLE_CAR.is_file():
        found.append(Car(CONSOLE, ((CONSOLE_CAR.name, CONSOLE_CAR.read_bytes()),)))
    for path in sorted(HOUSE_CARS.glob("*.onnx")):
        metadata = path.with_suffix(".json").read_bytes()
        found.append(Car(path.stem, ((path.name, path.read_bytes()), ("model_metadata.json", metadata))))
    return found


def admitted(car: Car) -> AdmittedCar:
    """Convert and gate, as an upload does. Raises UserFault."""
    package = admit([UploadPart(name, io.BytesIO(content)) for name, content in car.files])
    metadata, facts = package.metadata.to_dict(), package.facts.to_dict()
    return AdmittedCar(car.name, package.onnx, metadata, facts, package.parameters, package.macs)
