"""The two files of a house car, and what they are measured at."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evaluation.admit import AdmittedPackage, admit
from evaluation.pipeline import RaceJob, evaluate
from paddock.geometry.catalogue import by_slug
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules

from .recipes import TRACKS, Recipe

FOLDER = Path(__file__).parent
LAPS = 3
KEY = "house_car"
_BEGIN, _END = "<!-- lap times: begin -->", "<!-- lap times: end -->"


def write_car(folder: Path, recipe: Recipe, onnx: bytes, made: dict[str, Any]) -> AdmittedPackage:
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
    package = _admit(onnx, content)
    made.update(parameters=package.parameters, model_sha256=package.sha256)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{recipe.name}.onnx").write_bytes(onnx)
    _write_json(folder / f"{recipe.name}.json", content)
    return package


def measure_car(folder: Path, name: str) -> dict[str, dict[str, dict[str, Any]]]:
    """Three laps on each of :data:`.recipes.TRACKS`, both ways, through the platform's own sandboxed pipeline; written
    into the car's JSON and returned by track and direction. Raises PaddockError where an evaluation fails."""
    path = folder / f"{name}.json"
    content = json.loads(path.read_text())
    package = _admit((folder / f"{name}.onnx").read_bytes(), content)
    measured: dict[str, dict[str, dict[str, Any]]] = {}
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
    """Put the measured lap times of every car in ``folder`` into its README, between the two marks; nothing where there
    is no README."""
    readme = folder / "README.md"
    if not readme.exists():
        return
    cars = sorted(
        (json.loads(path.read_text())[KEY] for path in folder.glob("*.json")),
        key=lambda car: sum(found["best_lap_ms"] or 0 for ways in car["measured"].values() for found in ways.values()),
        reverse=True,  # the slowest first, as in the table of the cars
    )
    before, _, rest = readme.read_text().partition(_BEGIN)
    _, _, after = rest.partition(_END)
    table = "\n".join(_table_lines([car for car in cars if car["measured"]]))
    readme.write_text(f"{before}{_BEGIN}\n{table}\n{_END}{after}")


def _table_lines(cars: list[dict[str, Any]]) -> Iterable[str]:
    yield "| track | direction | " + " | ".join(car["display_name"] for car in cars) + " |"
    yield "|---|---|" + "---:|" * len(cars)
    for slug in TRACKS:
        for direction in ("ccw", "cw"):
            cells = [_cell(car["measured"][slug][direction]) for car in cars]
            yield f"| {by_slug(slug).name} | {direction} | " + " | ".join(cells) + " |"


def _cell(found: dict[str, Any]) -> str:
    if found["average_lap_ms"] is None:
        return "no lap"
    count = found["resets"]
    resets = f" ({count} reset{'s' * (count > 1)})" if count else ""
    return f"{found['average_lap_ms'] / 1000:.3f}{resets}"


def _admit(onnx: bytes, content: dict[str, Any]) -> AdmittedPackage:
    metadata = json.dumps(content).encode()
    return admit([UploadPart("model.onnx", io.BytesIO(onnx)), UploadPart("model_metadata.json", io.BytesIO(metadata))])


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n")
