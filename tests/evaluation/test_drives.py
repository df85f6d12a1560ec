"""Many laps of one car in one pair of sandboxed processes."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.garage.admission import admit
from evaluation.running.drives import DriveJob, LapDrive, drive_all
from evaluation.running.pipeline import RaceJob, evaluate
from evaluation.running.race_setup import Venue
from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.network.bound import NetworkFacts
from paddock.packages.read import UploadPart
from paddock.rules.report import LAP
from paddock.simulator.engine import ENGINE_ID
from paddock.simulator.randomisation import variations
from tests.sandbox.conftest import nothing_left  # noqa: F401
from tests.sandbox.networks import METADATA, constant_network, small_network
from tests.shared import CHECKOUT

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("nothing_left")]
HOUSE_CARS = CHECKOUT / "training" / "house_cars"


def venue(slug="oval", direction="ccw"):
    return Venue(by_slug(slug).geometry(direction), direction, "official")


def house_car(name="flyer"):
    files = [(f"{name}.onnx", HOUSE_CARS / f"{name}.onnx"), ("model_metadata.json", HOUSE_CARS / f"{name}.json")]
    car = admit([UploadPart(called, io.BytesIO(Path(path).read_bytes())) for called, path in files])
    return DriveJob(car.onnx, car.metadata.to_dict(), car.facts.to_dict(), ())


@pytest.fixture(scope="module")
def flyer():
    return house_car()


@pytest.fixture(scope="module")
def some():
    """A few variations, and a lap of each direction as it is."""
    of_all = variations(5, venue().track.length)
    picked = [LapDrive(one.number, venue(), one) for one in of_all[4::24]]
    return (*picked, LapDrive(100, venue()), LapDrive(101, venue(direction="cw")))


def test_each_lap_is_the_same_whatever_is_driven_with_it(flyer, some):
    heard = []
    together = drive_all(replace(flyer, drives=some), heard.append)
    assert heard == [1, 2, 3, 4, 5, 6] and together.engine == ENGINE_ID and not together.inexact
    apart = [drive_all(replace(flyer, drives=(one,))).drives[0] for one in (some[3], some[0])]
    assert [together.drives[3], together.drives[0]] == apart
    by_number = {one.number: one for one in together.drives}
    assert by_number[100].complete and by_number[100].percent == 100.0 and by_number[100].status == "Lap complete"
    assert len({one.trace_sha256 for one in together.drives}) == len(some)


def test_a_lap_without_a_variation_is_that_of_a_race(flyer):
    lap = drive_all(replace(flyer, drives=(LapDrive(0, venue()),))).drives[0]
    race = evaluate(RaceJob(venue().track, LAP, flyer.onnx, flyer.metadata, facts=flyer.facts))
    assert (lap.trace_sha256, lap.time_ms) == (race.trace_sha256, race.laps[0]["time_ms"])


def test_a_car_that_leaves_the_road_says_where():
    straight_on = DriveJob(constant_network((0.0, 9.0, 0.0)), METADATA, None, (LapDrive(0, venue()),))
    (lap,) = drive_all(straight_on).drives
    assert not lap.complete and lap.status == "Off track" and lap.end_reason == "resets_used"
    assert 0.0 < lap.percent < 60.0 and (lap.x, lap.y) != (0.0, 0.0)


def test_a_broken_bound_repeats_all_exactly(some):
    car = DriveJob(small_network(), METADATA, NetworkFacts(bound=None).to_dict(), some[:2])
    exactly = drive_all(car)
    trusting = drive_all(replace(car, facts=NetworkFacts(bound=0.0).to_dict()))
    assert trusting.inexact and trusting.drives == exactly.drives


def test_it_is_stopped_between_two_laps(flyer, some):
    done = []
    with pytest.raises(UserFault) as stopped:
        drive_all(replace(flyer, drives=some * 20), done.append, lambda: bool(done))
    assert stopped.value.code == "stopped" and len(done) < len(some * 20)
