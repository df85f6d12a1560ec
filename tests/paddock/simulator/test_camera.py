import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from PIL import Image

from paddock.simulator.camera.optics import FRONT_CAMERA, STEREO_RIGHT, Optics
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.camera.view import Camera, Scene
from paddock.simulator.car import Pose

from .tiny_scene import TinyScene
from .tracks_for_tests import stadium

TRACK = stadium()


@pytest.fixture(scope="module")
def scene():
    return Scene.of(TRACK)


@pytest.fixture(scope="module")
def camera(scene):
    return Camera(scene)


@pytest.fixture(scope="module")
def pairs(camera):
    """(warped, drawn by Bullet's TinyRenderer at 640x480 and shrunk as the official pipeline does) for many poses."""
    witness = TinyScene(TRACK, OFFICIAL)
    found = []
    for number, distance in enumerate(np.linspace(0, TRACK.length, 12, endpoint=False)):
        x, y, heading = TRACK.point_at(distance, 0.3 * math.sin(number))
        pose = Pose(x, y, heading + 0.3 * math.cos(3 * number))
        drawn = Image.fromarray(witness.render(pose)).resize((160, 120), Image.Resampling.BILINEAR)
        found.append((camera.render(pose), np.array(drawn)))
    witness.close()
    return found


def test_a_frame_is_a_fresh_grey_picture_of_official_size(camera):
    frame = camera.render(Pose(0.0, -1.2, 0.0))
    assert frame.shape == (120, 160) and frame.dtype == np.uint8 and frame.flags.c_contiguous
    kept = frame.copy()
    camera.render(Pose(1.0, -1.2, 0.5))
    assert (frame == kept).all()


@pytest.mark.slow
def test_bullets_renderer_draws_the_same_scene(pairs):
    differences = [np.abs(ours.astype(int) - theirs) for ours, theirs in pairs]
    assert np.mean(differences) < 1.5
    for difference in differences:
        assert difference.mean() < 2.5
        assert (difference > 40).mean() < 0.02


@pytest.mark.slow
def test_edges_agree_with_bullets_renderer(pairs):
    """Of all shifts by half pixels the pictures fit best with at most one of them: TinyRenderer itself is half of one
    of its four times smaller pixels off."""
    shifts = [(dx / 2, dy / 2) for dx in range(-3, 4) for dy in range(-3, 4)]

    def apart(shift):
        move = np.float32([[1, 0, shift[0]], [0, 1, shift[1]]])
        return sum(
            np.abs(
                cv2.warpAffine(ours.astype(np.float32), move, (160, 120), borderMode=cv2.BORDER_REPLICATE) - theirs
            ).mean()
            for ours, theirs in pairs
        )

    best = min(shifts, key=apart)
    assert max(map(abs, best)) <= 0.5
    for far in ((1.5, 0), (-1.5, 0), (0, 1.5), (0, -1.5)):
        assert apart(far) > 1.3 * apart(best)


def test_horizon_and_wall_have_their_geometric_height(camera, scene):
    xmax, middle = scene.walls[2], (scene.walls[1] + scene.walls[3]) / 2
    optics = FRONT_CAMERA
    for away in (0.5, 1.0, 3.0):
        frame = camera.render(Pose(xmax - away - optics.x, middle, 0.0))
        below = math.atan(optics.height / away) - optics.pitch
        foot = (optics.rows - 1) / 2 + optics.focal * math.tan(below)
        column = frame[:, 80].astype(float)
        # Where the brightness is half-way between the wall's and the field's.
        row = int(np.nonzero(column > (OFFICIAL.wall + OFFICIAL.field) / 2)[0][0])
        seen = row - (column[row] - (OFFICIAL.wall + OFFICIAL.field) / 2) / (column[row] - column[row - 1])
        assert seen == pytest.approx(foot, abs=0.8)


@pytest.mark.parametrize("level_m", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("optics", [FRONT_CAMERA, STEREO_RIGHT, Optics(pitch=0.6, columns=64, rows=48)])
def test_a_pixel_shows_the_ground_its_ray_meets(optics, level_m):
    eye = np.array((optics.x, optics.y, optics.height))
    axis = np.array((math.cos(optics.pitch), 0.0, -math.sin(optics.pitch)))
    down = np.array((-math.sin(optics.pitch), 0.0, -math.cos(optics.pitch)))
    for row in (0.0, optics.rows / 2, optics.rows - 1.25):
        ahead, left, step = optics.line_of_row(row, level_m)
        for column in (0, optics.columns - 1):
            ray = axis + down * (row - (optics.rows - 1) / 2) / optics.focal
            ray[1] = -(column - (optics.columns - 1) / 2) / optics.focal
            met = eye + ray * (level_m - optics.height) / ray[2]
            if np.dot(met - eye, axis) > 0:
                assert (ahead, left + column * step) == pytest.approx(tuple(met[:2]))
            else:  # it looks the other way
                assert ahead > 5000


def test_the_row_at_the_horizon_meets_no_ground():
    assert FRONT_CAMERA.line_of_row(FRONT_CAMERA.horizon)[0] > 9000


@pytest.mark.parametrize("pitch", [-1.2, 0.0, 0.8, 1.5])
def test_a_camera_may_look_up_or_down_past_its_horizon(scene, pitch):
    frame = Camera(scene, Optics(pitch=pitch)).render(Pose(0.0, -1.2, 0.0))
    assert (OFFICIAL.road in frame) == (pitch >= 0.0)


@pytest.mark.parametrize("pose", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan)])
def test_a_non_finite_pose_is_refused(camera, pose):
    with pytest.raises(ValueError, match="is not finite"):
        camera.render(Pose(*pose))


def test_only_walls_are_seen_from_far_outside(camera):
    for far in (100.0, 1e7, 1e300):
        assert set(camera.render(Pose(far, -far, 0.7)).ravel().tolist()) == {OFFICIAL.wall}


def test_every_part_of_a_picture_has_its_themes_grey(camera):
    # On the centre line of the lower straight: dash or road ahead, border lines and field to both sides.
    frame = camera.render(Pose(-1.0, -1.2, 0.0))
    values = set(frame[110].tolist())
    assert OFFICIAL.road in values
    assert OFFICIAL.dash in set(frame[60:, 79].tolist()) | set(frame[60:, 80].tolist())
    assert OFFICIAL.line in set(frame[45].tolist())
    assert OFFICIAL.field in set(frame[40].tolist())
    assert OFFICIAL.wall in set(frame[5].tolist())


@pytest.mark.parametrize("yaw", np.linspace(-math.pi, math.pi, 9))
def test_a_wall_through_the_near_plane_is_clipped(camera, scene, yaw):
    xmin, ymin, _, _ = scene.walls
    frame = camera.render(Pose(xmin + 0.2, ymin + 0.2, float(yaw)))
    # Nothing but the scene's greys and their mixtures, and the sky only ever above the horizon.
    horizon = math.ceil(FRONT_CAMERA.horizon)
    assert (frame[horizon + 1 :] <= OFFICIAL.line).all()
    assert not (np.abs(frame[horizon + 1 :].astype(int) - OFFICIAL.sky) < 3).sum() > 80


def test_distant_lines_do_not_flicker(camera):
    """A small step forward must change the far rows by little: without anti-aliasing they flicker."""
    frames = [camera.render(Pose(-1.9 + 0.01 * i, -1.2, 0.0))[27:40].astype(float) for i in range(20)]
    jumps = [np.abs(a - b).max() for a, b in pairwise(frames)]
    assert np.median(jumps) < 45


def test_the_road_is_drawn_between_its_borders(scene):
    level = scene.levels[0]
    to_pixels = level.from_ground()
    for distance in np.linspace(0, TRACK.length, 40, endpoint=False):
        for offset, grey in (
            (0.2, OFFICIAL.road),
            (0.47, OFFICIAL.line),
            (-0.47, OFFICIAL.line),
            (0.53, OFFICIAL.field),
        ):
            x, y, _ = TRACK.point_at(distance, offset)
            column, row, _ = to_pixels @ (x, y, 1.0)
            assert level.pixels[round(row), round(column)] == grey
