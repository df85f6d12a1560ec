"""Clips in perspective: where the cameras are, and what they show."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evaluation.appearance.looks import Shell
from tests.videos.drawing.runs import OVAL, SMALL, car, driven, lap, scene, with_reset
from videos.drawing import bodies, palette
from videos.drawing.lens import NEAR_M, PERSPECTIVE, FrameCamera, before_camera
from videos.drawing.panel import BAR
from videos.drawing.timeline import prepare
from videos.drawing.writing import Painter

SIZE = (SMALL.width, SMALL.height - BAR // 2)
FRAMES = [0, 45, 100, 149]


def taken(camera: str, count: float = 5.0, **more):
    return prepare(scene(car(driven(count), laps=[lap(1, 0, round(count * 1000))]), camera=camera, **more), SMALL)


def seen_at(take, frame: int, metres: float, left: float, up: float = 0.0) -> np.ndarray:
    """(column, row, depth) in px and metres of a point before and beside the followed car."""
    drive = take.hero.way
    x, y, yaw = (float(column[frame]) for column in (drive.x, drive.y, drive.yaw))
    cos, sin = math.cos(yaw), math.sin(yaw)
    sight = FrameCamera(take.lens, frame, SIZE)
    seen = sight.see(np.array([(x + metres * cos - left * sin, y + metres * sin + left * cos, up)]))
    return np.append(sight.place(seen)[0], seen[0, 2])


@pytest.mark.parametrize("frame", FRAMES)
def test_the_chase_camera_has_the_car_below_the_way_ahead_and_mirrors_nothing(frame):
    take = taken("chase")
    here, ahead, left = seen_at(take, frame, 0, 0), seen_at(take, frame, 2, 0), seen_at(take, frame, 0, 0.3)
    assert 0.3 * SIZE[0] < here[0] < 0.7 * SIZE[0] and SIZE[1] / 2 < here[1] < SIZE[1]
    assert ahead[1] < here[1] - 40 and ahead[2] > here[2] + 1.5
    assert left[0] < here[0] - 40
    assert seen_at(take, frame, 0, 0, 0.2)[1] < here[1]  # up is up
    assert 0.7 < here[2] < 1.1


@pytest.mark.parametrize("frame", FRAMES)
def test_the_onboard_camera_looks_ahead_from_the_car(frame):
    take = taken("onboard")
    drive = take.hero.way
    assert math.dist(take.lens.eye[frame], (drive.x[frame], drive.y[frame], 0.15)) == pytest.approx(0.04)
    column, row, _ = seen_at(take, frame, 1.4, 0.0, -0.08)
    assert (column, row) == pytest.approx((SIZE[0] / 2, SIZE[1] / 2))


def test_the_cameras_beside_the_road_stand_beside_it_and_hold_the_car_in_the_middle():
    take = taken("trackside", 12.0)
    posts = {tuple(post) for post in take.lens.eye.tolist()}
    assert len(posts) > 1 and not any(OVAL.on_road(x, y) for x, y, _ in posts)
    for frame in range(0, 360, 30):
        assert seen_at(take, frame, 0, 0, 0.06)[:2] == pytest.approx((SIZE[0] / 2, SIZE[1] / 2))


def test_the_chase_camera_turns_at_once_when_a_car_is_put_back():
    rows = with_reset(driven(4.0), 30, 6.0, 1.0)
    take = prepare(scene(car(rows, laps=[lap(1, 0, 3000)]), camera="chase"), SMALL)
    drive = take.hero.way
    frame = int(np.flatnonzero(drive.standing)[0])
    way = np.array((drive.x[frame], drive.y[frame])) - take.lens.eye[frame, :2]
    assert way / np.linalg.norm(way) == pytest.approx(
        (math.cos(drive.yaw[frame]), math.sin(drive.yaw[frame])), abs=0.01
    )


def test_an_outline_behind_the_camera_is_cut_off():
    square = np.array([(-1.0, 0.2, 2.0), (1.0, 0.2, 2.0), (1.0, 0.2, -2.0), (-1.0, 0.2, -2.0)])
    cut = before_camera(square)
    assert cut[:, 2].min() == pytest.approx(NEAR_M) and cut[:, 2].max() == 2.0 and len(cut) == 4
    assert np.ptp(cut[:, 0]) == 2.0
    away = np.array((0.0, 0.0, 3.0))
    assert before_camera(square + away).tolist() == (square + away).tolist()
    assert len(before_camera(square - away)) == 0


@pytest.mark.parametrize("shell", Shell.values)
def test_every_shell_is_a_solid_of_its_size_on_four_wheels_or_more(shell):
    mesh = bodies.car(shell, 0.3, 0.0)
    length, width, height = np.ptp(mesh.corners, axis=0)
    assert 0.27 < length < 0.37 and 0.13 < width < 0.22 and 0.05 < height < 0.16
    assert mesh.corners[:, 2].min() == pytest.approx(0.0, abs=0.002)
    wheels = bodies.wheels(shell)
    assert len(wheels) >= 4 and sum(wheel.steered for wheel in wheels) == 2
    body = bodies.body(shell)
    # faces look outwards: a point a little outside of the middle of the roof sees the roof
    roof = body.normals[(body.paints == bodies.BODY) & (body.normals[:, 2] > 0.8)]
    assert len(roof) > 3
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(np.ones(len(mesh.normals)))


def test_front_wheels_turn_to_the_left_with_the_steering():
    straight, left = (bodies.car("formula", steer, 0.0).corners for steer in (0.0, 0.4))
    moved = np.flatnonzero(np.abs(straight - left).max(axis=1) > 1e-6)
    assert (straight[moved, 0] > 0).all() and len(moved)
    foremost = moved[straight[moved, 0] > straight[moved, 0].max() - 1e-6]
    assert (left[foremost, 1] > straight[foremost, 1]).all()


def test_a_box_ahead_is_seen_where_it_stands_and_hides_what_is_behind_it():
    x, y, yaw = OVAL.point_at(3.0, 0.2)
    layout = {"boxes": [{"x": x, "y": y, "yaw": yaw}]}
    take = taken("onboard", layout=layout)
    frame = next(k for k in range(take.driven) if math.dist(take.lens.eye[k, :2], (x, y)) < 1.3)
    picture = Painter(take).frame(frame)
    (column, row) = FrameCamera(take.lens, frame, SIZE).place(
        FrameCamera(take.lens, frame, SIZE).see(np.array([(x, y, 0.06)]))
    )[0]
    blue, green, red = picture[round(row) + SMALL.height - SIZE[1], round(column)].astype(float)
    assert blue < green < red and red / blue == pytest.approx(palette.BOX[2] / palette.BOX[0], rel=0.1)


def test_each_camera_shows_another_picture_of_the_same_moment():
    pictures = [Painter(taken(camera)).frame(60).copy() for camera in (*PERSPECTIVE, "follow", "top")]
    for number, one in enumerate(pictures):
        assert all(np.abs(one.astype(int) - other).mean() > 4 for other in pictures[:number])


def test_the_car_that_is_followed_moves_under_the_chase_camera_and_the_road_with_it():
    painter = Painter(taken("chase"))
    one, two = painter.frame(60).copy().astype(int), painter.frame(61).astype(int)
    assert 0.2 < np.abs(one - two)[SMALL.height - SIZE[1] :].mean() < 20
