"""The two files of a house car, and its measured lap times."""

import io
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypedDict

from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.running.pipeline import RaceJob, evaluate
from paddock.geometry.catalogue import by_slug
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID

from .recipes import TRACKS, Recipe

FOLDER = Path(__file__).parent
LAPS = 3
KEY = "house_car"
ADMITTED = "admitted"
_BEGIN, _END = "<!-- lap times: begin -->", "<!-- lap times: end -->"


def write_car(folder: Path, recipe: Recipe, onnx: bytes, made: dict[str, object]) -> AdmittedPackage:
    """Write ``NAME.onnx`` and ``NAME.json`` once the platform's own gate has admitted them. Raises UserFault."""
    content = {
        **recipe.metadata,
        KEY: {
            "name": recipe.name,
            "display_name": recipe.display_name,
            "description": recipe.description,
            "made": made,
            "measured": {},
        },
    }
    package = _admit(onnx, json.dumps(content).encode())
    made.update(parameters=package.parameters, model_sha256=package.sha256)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{recipe.name}.onnx").write_bytes(onnx)
    _write_json(folder / f"{recipe.name}.json", content)
    return package


def admit_car(folder: Path, name: str) -> AdmittedPackage:
    """Admit a car, and write its canonical network and what was found into ``admitted/``. Raises UserFault."""
    package = _admit((folder / f"{name}.onnx").read_bytes(), (folder / f"{name}.json").read_bytes())
    (folder / ADMITTED).mkdir(exist_ok=True)
    (folder / ADMITTED / f"{name}.onnx").write_bytes(package.onnx)
    found = {
        "engine": ENGINE_ID,
        "source_sha256": package.source_sha256,
        "sha256": package.sha256,
        "parameters": package.parameters,
        "macs": package.macs,
        "facts": package.facts.to_dict(),
    }
    _write_json(folder / ADMITTED / f"{name}.json", found)
    return package


class Measured(TypedDict):
    """Three laps on one route; times are None without a complete lap."""

    complete_laps: int
    average_lap_ms: int | None
    best_lap_ms: int | None
    off_tracks: int
    resets: int


class MeasuredCar(TypedDict):
    display_name: str
    measured: dict[str, dict[str, Measured]]


def measure_car(folder: Path, name: str) -> dict[str, dict[str, Measured]]:
    """Three laps on each of :data:`.recipes.TRACKS`, both ways, in the sandboxed pipeline; written into the car's JSON
    and returned by track and direction. Raises PaddockError."""
    path = folder / f"{name}.json"
    content = json.loads(path.read_text())
    package = _admit((folder / f"{name}.onnx").read_bytes(), path.read_bytes())
    measured: dict[str, dict[str, Measured]] = {}
    for slug in TRACKS:
        track = by_slug(slug).geometry()
        for direction in ("ccw", "cw"):
            rules = RaceRules(laps=LAPS, direction=direction)
            outcome = evaluate(
                RaceJob(track, rules, package.onnx, package.metadata.to_dict(), facts=package.facts.to_dict())
            )
            times = [lap["time_ms"] for lap in outcome.laps if lap["complete"]]
            measured.setdefault(slug, {})[direction] = {
                "complete_laps": len(times),
                "average_lap_ms": round(sum(times) / len(times)) if times else None,
                "best_lap_ms": min(times, default=None),
                "off_tracks": sum(lap["off_tracks"] for lap in outcome.laps),
                "resets": sum(lap["resets"] for lap in outcome.laps),
            }
    content[KEY]["measured"] = measured
    content[KEY]["measured_on"] = {"engine": outcome.engine, "versions": outcome.versions, "cpu": outcome.cpu_model}
    _write_json(path, content)
    return measured


def write_table(folder: Path) -> None:
    """Write the measured lap times of all cars in ``folder`` into its README, if there is one."""
    readme = folder / "README.md"
    if not readme.exists():
        return
    cars: list[MeasuredCar] = sorted(
        (json.loads(path.read_text())[KEY] for path in folder.glob("*.json")),
        key=lambda car: sum(found["best_lap_ms"] or 0 for ways in car["measured"].values() for found in ways.values()),
        reverse=True,  # the slowest first, as in the table of the cars
    )
    before, _, rest = readme.read_text().partition(_BEGIN)
    _, _, after = rest.partition(_END)
    table = "\n".join(_table_lines([car for car in cars if car["measured"]]))
    readme.write_text(f"{before}{_BEGIN}\n{table}\n{_END}{after}")


def _table_lines(cars: list[MeasuredCar]) -> Iterable[str]:
    yield "| track | direction | " + " | ".join(car["display_name"] for car in cars) + " |"
    yield "|---|---|" + "---:|" * len(cars)
    for slug in TRACKS:
        for direction in ("ccw", "cw"):
            cells = [_cell(car["measured"][slug][direction]) for car in cars]
            yield f"| {by_slug(slug).name} | {direction} | " + " | ".join(cells) + " |"


def _cell(found: Measured) -> str:
    if found["average_lap_ms"] is None:
        return "no lap"
    count = found["resets"]
    resets = f" ({count} reset{'s' * (count > 1)})" if count else ""
    return f"{found['average_lap_ms'] / 1000:.3f}{resets}"


def _admit(onnx: bytes, metadata: bytes) -> AdmittedPackage:
    return admit([UploadPart("model.onnx", io.BytesIO(onnx)), UploadPart("model_metadata.json", io.BytesIO(metadata))])


def _write_json(path: Path, content: Mapping[str, object]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n")
