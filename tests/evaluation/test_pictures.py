"""The picture of what a car's sensors see shows their very readings."""

from __future__ import annotations

import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from evaluation.camera_replay.sensor_pictures import FAN_PX, GAP_PX, ZOOM, reading_picture, sensor_picture, views
from paddock.geometry.catalogue import CATALOGUE
from paddock.packages.inputs import CAMERAS, LIDARS
from paddock.simulator.camera.optics import FRONT_CAMERA
from paddock.simulator.camera.view import Camera, Scene

WIDTH, HEIGHT = 160 * ZOOM, 120 * ZOOM


@pytest.fixture(scope="module")
def oval():
    return next(track for track in CATALOGUE if track.slug == "oval").geometry()


def pixels(*arguments):
    picture = Image.open(io.BytesIO(sensor_picture(*arguments)))
    assert (picture.format, picture.mode) == ("PNG", "L")
    return np.array(picture)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("lidar", [None, *LIDARS])
def test_the_picture_has_three_rows_with_a_panel_per_sensor(camera, lidar, oval):
    picture = pixels(oval, [camera, *([lidar] if lidar else [])])
    frames = 2 if camera == "STEREO_CAMERAS" else 1
    width = frames * WIDTH + (frames - 1) * GAP_PX + (GAP_PX + FAN_PX if lidar else 0)
    assert picture.shape == (3 * HEIGHT + 2 * GAP_PX, width)


def test_frames_hold_the_cameras_own_pixels(oval):
    picture = pixels(oval, ["FRONT_FACING_CAMERA"])
    camera = Camera(Scene.of(oval), FRONT_CAMERA)
    for row, view in enumerate(views(oval)):
        top = row * (HEIGHT + GAP_PX)
        shown = picture[top : top + HEIGHT : ZOOM, ::ZOOM]
        assert (shown == camera.render(view, view.solids)).all()
        assert (shown != camera.render(view, ())).sum() > 300  # something stands ahead


@pytest.mark.parametrize("lidar", LIDARS)
def test_a_lidar_fan_shows_what_is_beside_and_behind(lidar, oval):
    """First row: a box to the left. Last row: a car behind on the right."""
    picture = pixels(oval, ["LEFT_CAMERA", lidar])
    fans = [
        picture[row * (HEIGHT + GAP_PX) :][:FAN_PX, -FAN_PX:].astype(int) == 255 for row in range(3)
    ]  # bright: a hit, or a sector that is on
    middle = FAN_PX // 2
    assert fans[0][:, :middle].any()
    if lidar != "DISCRETIZED_SECTOR_LIDAR":  # which reaches the wall on the right
        assert not fans[0][:, middle:].any()
    assert fans[2][middle:, middle:].any()


def test_a_picture_depends_on_sensors_and_configuration_alone(oval):
    sensors = ["STEREO_CAMERAS", "DISCRETIZED_SECTOR_LIDAR"]
    assert sensor_picture(oval, sensors) == sensor_picture(oval, sensors)
    assert sensor_picture(oval, sensors) != sensor_picture(oval, sensors, {"num_sectors": 16})
    assert len(sensor_picture(oval, sensors)) < 120_000


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_every_tracks_picture_shows_an_object(entry, direction):
    track = entry.geometry().in_direction(direction)
    camera = Camera(Scene.of(track), FRONT_CAMERA)
    for view in views(track):
        assert track.on_road(view.x, view.y)
        assert (camera.render(view, view.solids) != camera.render(view, ())).any()


def test_an_unknown_sensor_is_refused(oval):
    with pytest.raises(ValueError, match="RADAR"):
        sensor_picture(oval, ["RADAR"])


def test_a_reading_of_an_unknown_sensor_is_not_drawn_as_another(oval):
    with pytest.raises(ValueError, match="RADAR"):
        reading_picture({"RADAR": np.zeros(64, np.float32)}, views(oval)[0])


def test_drawing_imports_neither_django_nor_physics():
    code = (
        "import sys, evaluation.camera_replay.sensor_pictures; "
        "sys.exit(bool({'pybullet', 'django'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
