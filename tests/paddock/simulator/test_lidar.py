"""The lidar against rays that are walked by hand, and its three encodings."""

import itertools
import math
import random

import numpy as np
import pytest

from paddock.simulator.car import Pose
from paddock.simulator.lidar import BEAM_DEG, BEAMS, LEAST_M, MOUNT_X, discretized, raw, scan, sectors
from paddock.simulator.solids import Solid, box, car

HALL = (-6.0, -5.0, 6.0, 5.0)
FAR = (-100.0, -100.0, 100.0, 100.0)


def walked(pose, solids, hall, reach):
    """The same scan by crossing every beam with every side, one after another."""
    x, y = pose.ahead(MOUNT_X)
    found = []
    for bearing in BEAM_DEG:
        angle = pose.yaw + math.radians(bearing)
        dx, dy = math.cos(angle), math.sin(angle)
        nearest = reach
        xmin, ymin, xmax, ymax = hall
        outlines = [[(xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)]]
        for block in solids:
            corner = Pose(block.x, block.y, block.yaw).ahead
            length, width = block.half_length, block.half_width
            outlines.append([corner(length, width), corner(-length, width), corner(-length, -width)])
            outlines[-1].append(corner(length, -width))
        for outline in outlines:
            for (ax, ay), (bx, by) in zip(outline, outline[1:] + outline[:1], strict=True):
                ex, ey = bx - ax, by - ay
                cross = dx * ey - dy * ex
                if abs(cross) < 1e-12:
                    continue
                along = ((ax - x) * ey - (ay - y) * ex) / cross
                share = ((ax - x) * dy - (ay - y) * dx) / cross
                if along >= 0 and 0 <= share <= 1:
                    nearest = min(nearest, along)
        found.append(max(nearest, LEAST_M))
    return np.array(found)


@pytest.mark.parametrize("reach", [0.5, 1.0, 2.0, 12.0])
def test_every_beam_ends_where_a_hand_walked_ray_does(reach):
    rng = random.Random(5)
    for _ in range(60):
        solids = [
            rng.choice((box, car))(rng.uniform(-5, 5), rng.uniform(-4, 4), rng.uniform(-4, 4))
            for _ in range(rng.randrange(9))
        ]
        pose = Pose(rng.uniform(-5, 5), rng.uniform(-4, 4), rng.uniform(-math.pi, math.pi))
        ours, theirs = scan(pose, solids, HALL, reach), walked(pose, solids, HALL, reach)
        inside = any(
            abs(pose.ahead(MOUNT_X)[0] - block.x) < 0.3 and abs(pose.ahead(MOUNT_X)[1] - block.y) < 0.3
            for block in solids
        )
        if not inside:  # from within a block the walked ray sees its far side, the lidar its near one
            assert np.abs(ours - theirs).max() <= 0.005 + 1e-9


def test_a_scan_is_64_fresh_distances_in_whole_centimetres():
    first = scan(Pose(5.5, 4.0, 0.3), [box(5.0, 4.0, 1.0)], HALL)
    assert first.shape == (BEAMS,) and first.dtype == np.float64
    assert (first == np.round(first, 2)).all()
    again = scan(Pose(5.5, 4.0, 0.3), [box(5.0, 4.0, 1.0)], HALL)
    assert again is not first and (again == first).all()


def test_beams_run_from_front_left_over_the_rear_to_front_right():
    """The unit is mounted backwards: yaw pi, so its -150 degrees are the car's +30."""
    assert BEAM_DEG[0] == pytest.approx(30) and BEAM_DEG[63] == pytest.approx(-30)
    assert abs(BEAM_DEG[31]) > 177 and abs(BEAM_DEG[32]) > 177
    assert BEAM_DEG[31] > 0 > BEAM_DEG[32]
    assert {round((b - a) % 360, 6) for a, b in itertools.pairwise(BEAM_DEG)} == {round(300 / 63, 6)}


@pytest.mark.parametrize(
    ("bearing", "beams"),
    [(90, (13,)), (180, (31, 32)), (-90, (50,)), (45, (3,)), (-45, (60,)), (0, ())],
)
def test_a_box_appears_on_the_beams_that_point_at_it(bearing, beams):
    for yaw in (0.0, 2.0, -2.5):
        pose = Pose(3.0, -7.0, yaw)
        x, y = pose.ahead(MOUNT_X)
        angle = yaw + math.radians(bearing)
        small = Solid(x + 2.0 * math.cos(angle), y + 2.0 * math.sin(angle), angle, 0.09, 0.09, 0.25, "box")
        seen = np.flatnonzero(scan(pose, [small], FAR, 12.0) < 12.0)
        assert tuple(seen) == beams


def test_sixty_degrees_straight_ahead_are_blind():
    pose = Pose(0.0, 0.0, 0.0)
    assert (scan(pose, [box(0.6, 0.0, 0.0)], FAR, 12.0) == 12.0).all()


def test_the_nearer_block_hides_the_farther_one():
    pose = Pose(0.0, 0.0, 0.0)
    near, far = box(-1.0, 0.0, 0.0), box(-2.0, 0.0, 0.0)
    both = scan(pose, [far, near], FAR)
    assert (both == scan(pose, [near, far], FAR)).all()
    assert both[31] == pytest.approx(1.0 + MOUNT_X - 0.15, abs=0.006)
    assert scan(pose, [far], FAR)[31] == pytest.approx(2.0 + MOUNT_X - 0.15, abs=0.006)


def test_walls_are_seen_and_blocks_hide_them():
    pose = Pose(-5.0, 0.0, 0.0)
    assert scan(pose, [], HALL)[31] == pytest.approx(1.0 + MOUNT_X, abs=0.01)
    assert scan(pose, [box(-5.6, 0.0, 0.0)], HALL)[31] < 0.5
    assert scan(Pose(0, 0, 0), [], HALL, 1.0).max() == 1.0


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.03, 0.05)])
def test_a_block_touching_the_lidar_reads_the_least_distance(place):
    assert (scan(Pose(0, 0, 0), [car(*place, 0.4)], FAR) == LEAST_M).all()


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_beams_along_a_wall_give_finite_distances(yaw):
    scanned = scan(Pose(0.0, 0.0, yaw), [Solid(0.0, 1.0, 0.0, 0.2, 0.2, 0.3, "box")], HALL)
    assert np.isfinite(scanned).all()


def test_a_scan_outside_the_hall_stays_within_range():
    scanned = scan(Pose(20.0, 0.0, 0.0), [], HALL)
    assert ((scanned >= LEAST_M) & (scanned <= 12.0)).all()


# --- encodings ---------------------------------------------------------------------------------------------------


def test_the_plain_lidar_is_clipped_to_a_metre():
    reading = raw(np.linspace(0.1, 12, BEAMS))
    assert reading.dtype == np.float32 and reading.shape == (64,)
    assert (reading.min(), reading.max()) == (np.float32(0.15), 1.0)


def test_a_sector_is_on_under_half_a_metre():
    distances = np.full(BEAMS, 12.0)
    distances[8:16] = 0.5  # not nearer than half a metre
    distances[23] = 0.49
    distances[63] = 0.15
    reading = sectors(distances)
    assert reading.dtype == np.float32
    assert reading.tolist() == [0, 0, 1, 0, 0, 0, 0, 1]


def test_discretized_sectors_are_one_hot_or_all_zeros():
    distances = np.full(BEAMS, 12.0)
    distances[0] = 0.15  # sector 0, first step
    distances[17] = 0.25  # sector 2: the edge of two steps belongs to the farther one
    distances[24:32] = 1.99
    distances[40] = 2.0  # as far as the clipping distance: nothing
    reading = discretized(distances, 8, 8, 2.0)
    assert reading.dtype == np.float32 and reading.shape == (64,)
    groups = reading.reshape(8, 8)
    assert [row.argmax() if row.any() else None for row in groups] == [0, None, 1, 7, None, None, None, None]
    assert set(reading.tolist()) == {0.0, 1.0}


@pytest.mark.parametrize("num_sectors", [1, 2, 4, 8, 16, 32, 64])
@pytest.mark.parametrize(("values", "limit"), [(1, 0.5), (3, 0.7), (11, 1.1), (7, 0.7), (64, 12.0), (5, 0.15)])
def test_every_configuration_follows_the_original_formula(num_sectors, values, limit):
    """ObservationSectorDiscretizeFilter of deepracer-simapp, in whole centimetres so that no rounding decides."""
    rng = np.random.default_rng(num_sectors)
    distances = np.round(rng.uniform(0.15, 1.5 * limit + 0.2, BEAMS), 2)
    groups = discretized(distances, num_sectors, values, limit).reshape(num_sectors, values)
    for nearest, row in zip(distances.reshape(num_sectors, -1).min(axis=1), groups, strict=True):
        centimetres = round(float(nearest) * 100)
        if centimetres >= round(limit * 100):
            assert not row.any()
        else:
            assert row.sum() == 1 and row[centimetres * values // round(limit * 100)] == 1


def test_binary_sectors_equal_discretized_ones_of_one_value():
    distances = np.round(np.random.default_rng(1).uniform(0.15, 2, BEAMS), 2)
    assert (sectors(distances) == discretized(distances, 8, 1, 0.5)).all()
