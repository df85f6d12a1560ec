"""Boxes and cars in the camera's picture."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from paddock.simulator.camera.optics import FRONT_CAMERA, STEREO_LEFT, STEREO_RIGHT
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.camera.view import Camera, Scene
from paddock.simulator.car import Pose
from paddock.simulator.solids import BOX, CAR, Solid, box, car
from tests.soak import examples

from .tiny_scene import TinyScene
from .tracks_for_tests import stadium

TRACK = stadium()
HERE = Pose(-1.5, -1.2, 0.0)  # on the lower straight, looking along it
EYE = HERE.ahead(FRONT_CAMERA.x)


@pytest.fixture(scope="module")
def scene():
    return Scene.of(TRACK)


@pytest.fixture(scope="module")
def camera(scene):
    return Camera(scene)


def before_the_eye(forward: float, left: float = 0.0, yaw: float = 0.0, make=box) -> Solid:
    """A solid whose middle is so far from the camera of a car at HERE."""
    return make(EYE[0] + forward, EYE[1] + left, yaw)


def count(frame: np.ndarray, grey: int) -> int:
    return int((frame == grey).sum())


BACK = OFFICIAL.box[2]  # of a box that heads as the car does


@pytest.mark.slow
def test_bullets_renderer_draws_the_same_boxes(camera):
    boxes = tuple(
        box(*TRACK.point_at(distance, side)[:2], TRACK.point_at(distance)[2] + turn)
        for distance, side, turn in ((0.6, 0.25, 0.0), (1.2, -0.25, 0.4), (3.0, 0.2, 1.0), (5.5, -0.2, 0.0))
    )
    witness = TinyScene(TRACK, OFFICIAL, boxes)
    differences = []
    shown = 0
    for number, distance in enumerate(np.linspace(-1.0, 5.0, 14)):
        x, y, heading = TRACK.point_at(distance, 0.2 * math.sin(number))
        pose = Pose(x, y, heading + 0.2 * math.cos(3 * number))
        if min(math.dist(pose.ahead(FRONT_CAMERA.x), solid[:2]) for solid in boxes) < 0.35:
            continue  # TinyRenderer does not cut what touches the lens
        drawn = Image.fromarray(witness.render(pose)).resize((160, 120), Image.Resampling.BILINEAR)
        frame = camera.render(pose, boxes)
        shown += (frame != camera.render(pose)).mean() > 0.01
        differences.append(np.abs(frame.astype(int) - np.array(drawn)))
    witness.close()
    assert shown >= 7, "boxes are in view in most of these pictures"
    assert np.mean(differences) < 1.5
    for difference in differences:
        assert difference.mean() < 2.5
        assert (difference > 40).mean() < 0.02


def test_no_solids_change_nothing(camera):
    for distance in np.linspace(0.0, TRACK.length, 20):
        pose = Pose(*TRACK.point_at(distance, 0.2))
        assert (camera.render(pose, ()) == camera.render(pose)).all()


def test_a_solid_out_of_view_changes_nothing(camera):
    empty = camera.render(HERE)
    for forward, left in ((-1.0, 0.0), (1.0, 3.0), (1.0, -3.0), (-0.5, 0.5)):
        assert (camera.render(HERE, (before_the_eye(forward, left),)) == empty).all()


@pytest.mark.parametrize("away", [0.4, 1.0, 2.5])
def test_a_box_has_its_geometric_size_and_place(camera, away):
    solid = before_the_eye(away + 0.15)  # its near face is `away` from the eye
    changed = camera.render(HERE, (solid,)) != camera.render(HERE)
    columns, rows = np.nonzero(changed.any(axis=0))[0], np.nonzero(changed.any(axis=1))[0]
    optics = FRONT_CAMERA

    def row(height: float) -> float:
        below = math.atan((optics.height - height) / away) - optics.pitch
        return (optics.rows - 1) / 2 + optics.focal * math.tan(below)

    lid_depth = away * math.cos(optics.pitch) - (0.25 - optics.height) * math.sin(optics.pitch)  # where it is widest
    assert np.ptp(columns) + 1 == pytest.approx(0.4 * optics.focal / lid_depth, abs=3)
    assert columns.mean() == pytest.approx((optics.columns - 1) / 2, abs=0.6)
    assert rows[-1] == pytest.approx(min(row(0.0), optics.rows - 1), abs=1.0)
    assert rows[0] == pytest.approx(max(row(0.25), 0.0), abs=1.0)


def test_the_nearer_box_hides_the_farther_in_any_order(camera):
    near, far = before_the_eye(0.8), before_the_eye(1.6)
    alone = camera.render(HERE, (near,))
    for both in ((near, far), (far, near)):
        assert (camera.render(HERE, both) == alone).all()


def test_a_box_half_behind_another_shows_its_other_half(camera):
    near, far = before_the_eye(0.8, 0.0), before_the_eye(1.6, 0.4)
    together = camera.render(HERE, (near, far))
    only_near, only_far = camera.render(HERE, (near,)), camera.render(HERE, (far,))
    empty = camera.render(HERE)
    of_near, of_far = only_near != empty, only_far != empty
    assert (of_near & of_far).sum() > 20, "they overlap in the picture"
    assert (together[of_near & (only_near == BACK)] == BACK).all()
    free = of_far & ~of_near
    assert (together[free] == only_far[free]).all() and free.sum() > 20


def test_the_nearest_point_decides_which_box_hides_which(camera):
    """The long one's middle is farther off than the small one's, and yet it stands before it."""
    long = Solid(EYE[0] + 1.0, EYE[1] + 0.12, 0.0, 0.7, 0.1, 0.25, BOX)  # from 0.3 to 1.7 ahead
    small = Solid(EYE[0] + 0.9, EYE[1] + 0.45, 0.0, 0.1, 0.1, 0.25, CAR)  # beside it, to the left
    both = camera.render(HERE, (long, small))
    assert (both == camera.render(HERE, (small, long))).all()
    alone = camera.render(HERE, (long,))
    shown = alone != camera.render(HERE)
    assert (both[shown] == alone[shown]).mean() > 0.98


def test_boxes_hide_walls_lines_and_sky(camera):
    frame = camera.render(HERE, (before_the_eye(0.4),))
    # Between the rows of its lid and its foot the middle of the picture is one grey.
    assert set(frame[20:80, 70:90].ravel().tolist()) == {BACK}


def test_a_box_seen_at_a_corner_shows_two_greys(camera):
    frame = camera.render(HERE, (before_the_eye(0.9, 0.0, 0.8),))
    greys = [grey for grey in OFFICIAL.box if count(frame, grey) > 50]
    assert len(greys) == 2


@pytest.mark.parametrize("turn, face", [(0.0, 2), (math.pi, 0), (math.pi / 2, 1), (-math.pi / 2, 3)])
def test_each_face_has_its_own_grey(camera, turn, face):
    # Seen from behind, from before, from its left, from its right.
    frame = camera.render(HERE, (before_the_eye(0.8, 0.0, turn),))
    assert count(frame, OFFICIAL.box[face]) > 200
    assert all(count(frame, grey) < 20 for number, grey in enumerate(OFFICIAL.box) if number != face)


def test_a_box_at_the_bumper_fills_the_picture(camera):
    # The car's nose is a few centimetres before the camera; here the box touches even the lens.
    frame = camera.render(HERE, (before_the_eye(0.15 + 0.03),))
    assert (frame == BACK).all()


def test_a_box_partly_behind_the_camera_is_clipped(camera):
    # A long one, beside the lens and reaching past it: it covers the picture's left, and the right is untouched.
    solid = Solid(EYE[0], EYE[1] + 0.3, 0.0, 1.0, 0.2, 0.25, BOX)
    frame, empty = camera.render(HERE, (solid,)), camera.render(HERE)
    side = OFFICIAL.box[3]
    assert (frame[60:, :10] == side).all()
    assert (frame[:, 85:] == empty[:, 85:]).all()


def test_a_box_around_the_camera_is_invisible(camera):
    assert (camera.render(HERE, (before_the_eye(0.0),)) == camera.render(HERE)).all()


def test_a_far_box_is_small_but_visible(camera):
    changed = camera.render(HERE, (before_the_eye(4.5),)) != camera.render(HERE)
    assert 20 < changed.sum() < 250
    assert changed[:28].any() and changed[29:].any()  # it is higher than the camera


def test_a_car_has_window_and_wheels_only_up_close(camera):
    near = camera.render(HERE, (before_the_eye(0.8, 0.0, math.pi / 2, car),))
    assert count(near, OFFICIAL.car[1]) > 150
    assert count(near, OFFICIAL.car_window) > 60
    assert count(near, OFFICIAL.car_wheel) > 30
    far = camera.render(HERE, (before_the_eye(3.0, 0.0, math.pi / 2, car),))
    assert count(far, OFFICIAL.car[1]) > 10
    assert count(far, OFFICIAL.car_wheel) == 0


def test_the_left_camera_sees_a_near_box_farther_right(scene):
    def middle(optics):
        camera = Camera(scene, optics)
        changed = camera.render(HERE, (before_the_eye(0.8),)) != camera.render(HERE)
        return np.nonzero(changed[40])[0].mean()

    optics = FRONT_CAMERA
    down = (40 - (optics.rows - 1) / 2) / optics.focal
    depth = 0.65 / (math.cos(optics.pitch) - math.sin(optics.pitch) * down)  # where the rays of row 40 meet the face
    apart = middle(STEREO_LEFT) - middle(STEREO_RIGHT)
    assert apart == pytest.approx(0.06 * optics.focal / depth, abs=1.0)
    assert (STEREO_LEFT.y, STEREO_RIGHT.y) == (0.03, -0.03)


def test_stereo_cameras_differ_from_the_front_one_only_by_place():
    for optics in (STEREO_LEFT, STEREO_RIGHT):
        assert replace(optics, y=0.0) == FRONT_CAMERA


metres = st.floats(-12.0, 12.0)
angles = st.floats(-10.0, 10.0)
blocks = st.builds(
    Solid, metres, metres, angles, st.floats(0.01, 2.0), st.floats(0.01, 2.0), st.floats(0.01, 2.0),
    st.sampled_from((BOX, CAR)),
)  # fmt: skip


@settings(max_examples=examples(300), deadline=None)
@given(st.builds(Pose, metres, metres, angles), st.lists(blocks, max_size=6))
def test_any_solids_can_be_drawn_from_any_place(scene, pose, solids):
    camera = Camera(scene)
    frame = camera.render(pose, solids)
    assert frame.shape == (120, 160)
    assert (frame == camera.render(pose, solids)).all()
    known = {OFFICIAL.road, OFFICIAL.line, OFFICIAL.dash, OFFICIAL.field, OFFICIAL.wall, OFFICIAL.sky}
    assert frame.max() <= max(known)


@settings(max_examples=examples(200), deadline=None)
@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), angles, st.sampled_from((box, car)))
def test_a_solid_touching_the_camera_shows_only_its_own_greys(scene, forward, left, yaw, make):
    """No polygon is turned inside out where it passes through the plane of the lens: every pixel is the scene's or
    between it and the solid's."""
    camera = Camera(scene)
    empty = camera.render(HERE)
    frame = camera.render(HERE, (before_the_eye(forward, left, yaw, make),))
    changed = frame != empty
    own = set(OFFICIAL.box) if make is box else {*OFFICIAL.car, OFFICIAL.car_window, OFFICIAL.car_wheel}
    if changed.any():
        values = frame[changed].astype(int)
        low = np.minimum(empty[changed], min(own))
        high = np.maximum(empty[changed], max(own))
        assert ((values >= low) & (values <= high)).all()
