import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import read_npy
from paddock.simulator.progress import STRIDE_M, Odometer, Reach
from tests.shared import SHARED, needs_shared

from .tracks_for_tests import hairpin, stadium


def test_on_a_straight_the_reach_is_a_stride_and_a_half():
    track = stadium()
    assert Reach(track).gains[0] == pytest.approx(1.5 * STRIDE_M, abs=0.1)


def test_a_bend_extends_the_reach():
    track = stadium(radius=0.8, width=1.0)
    bend = int(np.argmax(track.centre[:, 0]))
    # The inner border has a radius of 0.3 m, the centre line one of 0.8 m.
    assert Reach(track).gains[bend] == pytest.approx(1.5 * STRIDE_M * 0.8 / 0.3, abs=0.3)


def test_a_tight_hairpin_keeps_the_reach_within_the_window():
    reach = Reach(hairpin())
    assert max(reach.gains) <= 1.5 * 2.0


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_driving_along_either_border_counts_the_whole_lap(entry, direction):
    track = entry.geometry().in_direction(direction)
    reach = Reach(track)
    for share in (-0.95, 0.0, 0.95):
        odometer = Odometer(track, reach)
        distance, refused = 0.0, 0
        x, y, _ = track.point_at(0.0)
        while distance < track.length:
            left, right = track.half_widths_at(distance)
            offset = share * (left if share > 0 else right)
            distance += 0.05
            x, y, _ = track.point_at(distance, offset)
            refused += not odometer.move(x, y)
        assert refused == 0
        assert odometer.metres == pytest.approx(distance, abs=0.05)


@needs_shared
@pytest.mark.parametrize("name", ["reInvent2019_wide", "Austin", "caecer_loop", "reinvent_base"])
def test_driving_along_real_borders_is_never_refused(name):
    track = read_npy((SHARED / "tracks" / f"{name}.npy").read_bytes(), name)
    reach = Reach(track)
    for border in (track.left, track.right, track.centre):
        odometer = Odometer(track, reach)
        line = np.vstack([border, border[:1]])
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
        odometer.put(*line[0], 0.0)
        strides = np.arange(STRIDE_M * 0.9, along[-1], STRIDE_M * 0.9)
        refused = 0
        for x, y in zip(np.interp(strides, along, line[:, 0]), np.interp(strides, along, line[:, 1]), strict=True):
            refused += not odometer.move(float(x), float(y))
        assert refused == 0
        assert odometer.metres == pytest.approx(track.length, abs=2.0)
