"""The committed house cars are cars that anybody could have uploaded, and they drive."""

from __future__ import annotations

import io
import json

import pytest

from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.running.pipeline import RaceJob, evaluate
from league.house_cars.services import _files, _recorded_admission, house_cars
from league.seasons.services.demo_season import OPEN_TRACKS, PRO_TRACKS
from paddock.geometry.catalogue import by_slug
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart, read_upload
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.race import Entrant, RaceSettings, run_race
from training.house_cars.environment import SENSOR, OnnxDriver
from training.house_cars.files import FOLDER, KEY, LAPS
from training.house_cars.recipes import RECIPES, TRACKS

pytestmark = pytest.mark.slow

NAMES = sorted(path.stem for path in FOLDER.glob("*.onnx"))


def content(name: str) -> dict:
    return json.loads((FOLDER / f"{name}.json").read_text())


def admitted(name: str) -> AdmittedPackage:
    files = {"model.onnx": FOLDER / f"{name}.onnx", "model_metadata.json": FOLDER / f"{name}.json"}
    return admit([UploadPart(part, io.BytesIO(file.read_bytes())) for part, file in files.items()])


def test_at_least_three_recipes_each_have_a_car() -> None:
    assert set(NAMES) == set(RECIPES)
    assert len(NAMES) >= 3


@pytest.mark.parametrize("name", NAMES)
def test_a_cars_metadata_is_valid_and_agrees_with_its_recipe(name: str) -> None:
    data = (FOLDER / f"{name}.json").read_bytes()

    metadata = parse_metadata(data)

    assert metadata == parse_metadata(json.dumps(RECIPES[name].metadata).encode())
    car = json.loads(data)[KEY]
    assert (car["name"], car["display_name"]) == (name, RECIPES[name].display_name)
    assert car["description"] == RECIPES[name].description


@pytest.mark.parametrize("name", NAMES)
def test_each_car_was_measured_on_this_engine(name: str) -> None:
    """Retrain or measure again (``python -m training.house_cars --measure``) when the engine's number changes."""
    assert content(name)[KEY]["measured_on"]["engine"] == ENGINE_ID


@pytest.mark.parametrize("name", NAMES)
def test_each_car_is_small_and_passes_the_gate(name: str) -> None:
    onnx = (FOLDER / f"{name}.onnx").read_bytes()
    assert len(onnx) <= 1_000_000

    package = admitted(name)

    assert package.sha256 == content(name)[KEY]["made"]["model_sha256"]


@pytest.mark.parametrize("name", NAMES)
def test_the_recorded_admission_is_what_the_sandbox_finds(name: str) -> None:
    """After a change of the conversion or its facts: ``python -m training.house_cars --admit``."""
    car = next(car for car in house_cars() if car.name == name)
    assert _recorded_admission(car, read_upload(_files(car))) == admit(_files(car))


@pytest.mark.parametrize("slug", ["oval", "baja-turnpike"])
@pytest.mark.parametrize("name", NAMES)
def test_each_car_repeats_its_recorded_laps_to_the_millisecond(name: str, slug: str) -> None:
    package = admitted(name)

    outcome = evaluate(
        RaceJob(by_slug(slug).geometry("ccw"), RaceRules(laps=LAPS), package.onnx, package.metadata.to_dict())
    )

    recorded = content(name)[KEY]["measured"][slug]["ccw"]
    times = [lap["time_ms"] for lap in outcome.laps]
    assert [lap["complete"] for lap in outcome.laps] == [True] * LAPS
    assert (min(times), round(sum(times) / LAPS)) == (recorded["best_lap_ms"], recorded["average_lap_ms"])
    assert sum(lap["resets"] for lap in outcome.laps) == recorded["resets"]


@pytest.mark.parametrize(("name", "direction"), [("steady", "ccw"), ("brisk", "cw")])
def test_a_car_trained_on_loops_drives_the_straight_track_to_its_end(name: str, direction: str) -> None:
    driver = OnnxDriver((FOLDER / f"{name}.onnx").read_bytes())
    space = ActionSpace.from_metadata(RECIPES[name].metadata)
    rules = RaceRules(laps=2, direction=direction)

    laps = run_race(RaceSettings(by_slug("straight-track").geometry(), rules, [Entrant(space, [SENSOR], driver)])).laps

    assert [(lap.complete, lap.resets) for lap in laps] == [(True, 0)] * 2
    assert abs(laps[0].time_ms - laps[1].time_ms) <= 1


def drives(name: str) -> dict[tuple[str, str], dict]:
    measured = content(name)[KEY]["measured"]
    return {(slug, way): drive for slug, ways in measured.items() for way, drive in ways.items()}


def test_the_record_covers_every_track_of_the_season_both_ways() -> None:
    for name in NAMES:
        assert set(drives(name)) == {(slug, way) for slug in TRACKS for way in ("ccw", "cw")}
    assert set(TRACKS) >= {*OPEN_TRACKS, *PRO_TRACKS}


def test_three_cars_finish_on_every_track() -> None:
    for name in NAMES:
        assert all(drive["complete_laps"] == LAPS for drive in drives(name).values()), name


def test_their_paces_differ_clearly_on_every_track() -> None:
    slow, middle, fast = (drives(name) for name in ("steady", "brisk", "flyer"))
    for place in slow:
        times = [each[place]["average_lap_ms"] for each in (fast, middle, slow)]
        assert times[0] < 0.95 * times[1] < 0.95 * 0.95 * times[2], place


def test_the_steady_car_never_leaves_the_road_and_the_others_seldom() -> None:
    left = {name: sorted(drive["resets"] for drive in drives(name).values() if drive["resets"]) for name in NAMES}
    assert left["steady"] == []
    # most of them on Kuei Super Raceway, counter-clockwise
    assert len(left["brisk"]) <= 2 and sum(left["brisk"]) <= 4
    assert len(left["flyer"]) <= 3 and sum(left["flyer"]) <= 9
