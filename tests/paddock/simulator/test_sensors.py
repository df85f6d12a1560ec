"""What each sensor of a car reads, and how it is laid out."""

import math

import numpy as np
import pytest

from paddock.packages.inputs import SENSOR_NAMES, input_spec
from paddock.rules.race import RaceRules
from paddock.simulator.camera.optics import FRONT_CAMERA, STEREO_LEFT, STEREO_RIGHT
from paddock.simulator.camera.view import Camera, Scene
from paddock.simulator.car import Pose
from paddock.simulator.sensors import POSE, SENSORS, make_sensors, sensor_spec
from paddock.simulator.solids import box, car
from paddock.simulator.stage import PreparedTrack, Simulation
from paddock.simulator.world import World

from .tracks_for_tests import stadium

TRACK = stadium()
HERE = Pose(0.0, -1.2, 0.0)


@pytest.fixture(scope="module")
def scene():
    return Scene.of(TRACK)


@pytest.fixture(scope="module")
def mine():
    with World() as world:
        body = world.add_car()
        body.place(HERE)
        yield body


def read(name, scene, body, solids=(), lidar_config=None):
    return make_sensors([name], lambda: scene, lidar_config)[name](body, solids)


def test_the_simulator_has_every_sensor_metadata_may_name():
    assert set(SENSORS) == set(SENSOR_NAMES)


@pytest.mark.parametrize("config", [None, {"num_sectors": 16, "num_values_per_sector": 3, "clipping_dist": 4.0}])
@pytest.mark.parametrize("name", SENSOR_NAMES)
def test_a_reading_matches_its_spec_and_the_networks_input(name, config, scene, mine):
    spec = sensor_spec(name, config)
    assert spec.shape == input_spec(name, config).shape
    reading = read(name, scene, mine, [box(-0.6, -1.2, 0.0)], config)
    assert (reading.shape, reading.dtype.name) == (spec.shape, spec.dtype)
    assert reading.min() >= spec.low and reading.max() <= spec.high


@pytest.mark.parametrize("name", SENSOR_NAMES)
def test_readings_are_fresh_arrays_and_repeatable(name, scene, mine):
    reading = make_sensors([name], lambda: scene)[name]
    first = reading(mine, [box(1.0, -1.0, 0.2)])
    kept = first.copy()
    reading(mine, [])
    assert (first == kept).all()
    assert (reading(mine, [box(1.0, -1.0, 0.2)]) == kept).all()


def test_an_unknown_sensor_is_refused(scene):
    with pytest.raises(ValueError, match="RADAR"):
        make_sensors(["FRONT_FACING_CAMERA", "RADAR"], lambda: scene)
    with pytest.raises(ValueError, match="RADAR"):
        sensor_spec("RADAR")


def test_sensors_are_ordered_by_name(scene):
    assert list(make_sensors(["STEREO_CAMERAS", "LIDAR"], lambda: scene)) == ["LIDAR", "STEREO_CAMERAS"]


def test_no_scene_is_drawn_for_a_driver_that_reads_poses(mine):
    def drawn():
        raise AssertionError("drawn")

    assert make_sensors([POSE], drawn)[POSE](mine, ()).shape == (4,)


def test_a_left_camera_without_a_pair_is_the_front_camera(scene, mine):
    solids = [box(1.0, -1.1, 0.0), car(2.0, -1.4, 0.1)]
    front = read("FRONT_FACING_CAMERA", scene, mine, solids)
    assert (front == read("LEFT_CAMERA", scene, mine, solids)).all()
    assert (front == read("observation", scene, mine, solids)).all()
    assert (front[:, :, 0] == Camera(scene, FRONT_CAMERA).render(HERE, solids)).all()


def test_stereo_gives_the_left_picture_then_the_right(scene, mine):
    solids = [box(1.0, -1.2, 0.0)]
    pair = read("STEREO_CAMERAS", scene, mine, solids)
    assert (pair[:, :, 0] == Camera(scene, STEREO_LEFT).render(HERE, solids)).all()
    assert (pair[:, :, 1] == Camera(scene, STEREO_RIGHT).render(HERE, solids)).all()
    # A box straight ahead is farther right in the left picture, and nearer boxes are shifted more.
    empty = read("STEREO_CAMERAS", scene, mine)

    def middles(x):
        seen = read("STEREO_CAMERAS", scene, mine, [box(x, -1.2, 0.0)]) != empty
        return [np.flatnonzero(seen[:, :, channel].any(axis=0)).mean() for channel in (0, 1)]

    near, far = middles(0.7), middles(2.0)
    assert near[0] - near[1] > far[0] - far[1] > 0


@pytest.mark.parametrize("name", ["FRONT_FACING_CAMERA", "STEREO_CAMERAS", "LIDAR", "SECTOR_LIDAR"])
@pytest.mark.parametrize("make", [box, car])
def test_boxes_and_cars_are_visible(name, make, scene, mine):
    ahead = name.endswith(("CAMERA", "CAMERAS"))
    x, y = HERE.ahead(0.8 if ahead else -0.4, 0.0)
    assert (read(name, scene, mine, [make(x, y, 0.0)]) != read(name, scene, mine)).any()


def test_the_lidar_sees_the_hall_but_no_track_lines(scene, mine):
    """The lane's borders lie 0.5 m to each side, the wall 1.26 m to the right."""
    reading = read("DISCRETIZED_SECTOR_LIDAR", scene, mine, (), {"clipping_dist": 12.0})
    assert reading.reshape(8, 8).any(axis=1).all()  # walls on every side, nearer than 12 m
    assert (read("LIDAR", scene, mine) == 1.0).all()


def test_a_car_senses_boxes_with_its_lidar_configuration():
    rules = RaceRules(race_type="object_avoidance", random_boxes=3, seed=4)
    config = {"num_sectors": 4, "num_values_per_sector": 2, "clipping_dist": 12.0}
    with Simulation(PreparedTrack(TRACK), rules) as stage:
        competitor = stage.add(["FRONT_FACING_CAMERA", "DISCRETIZED_SECTOR_LIDAR"], 0.0, config)
        readings = competitor.observe()
        solids = stage.solids(competitor)
        alone = make_sensors(["FRONT_FACING_CAMERA"], lambda: stage.ground.scene)
        assert (readings["FRONT_FACING_CAMERA"] == alone["FRONT_FACING_CAMERA"](competitor.car, solids)).all()
        assert readings["DISCRETIZED_SECTOR_LIDAR"].shape == (8,)
        assert not math.isnan(readings["DISCRETIZED_SECTOR_LIDAR"].sum())


@pytest.mark.parametrize("name", [*SENSOR_NAMES, POSE])
def test_a_reading_in_a_place_is_the_same_and_its_old_content_does_not_matter(name, scene, mine):
    reading, solids = make_sensors([name], lambda: scene)[name], [box(0.8, -1.2, 0.2)]
    for seen in (solids, ()):
        fresh = reading(mine, seen)
        place = np.full_like(fresh, 77)
        assert reading(mine, seen, place) is place
        assert place.tobytes() == fresh.tobytes()


def test_a_car_that_is_given_places_fills_them_and_hands_them_back():
    with Simulation(PreparedTrack(TRACK), RaceRules()) as stage:
        competitor = stage.add(["FRONT_FACING_CAMERA", "SECTOR_LIDAR"])
        fresh = competitor.observe()
        places = {name: np.zeros_like(reading) for name, reading in fresh.items()}
        assert competitor.observe(places) is places
        for name, reading in fresh.items():
            assert (places[name] == reading).all()
