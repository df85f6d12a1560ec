"""A track that ends: where its points are, what is road, and what is refused."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.geometry.character import character_of
from paddock.geometry.files import read_npy, write_npy
from paddock.geometry.open_track import RUN_OFF_M, OpenTrack
from paddock.geometry.track import TrackGeometry


@pytest.fixture(scope="module")
def straight():
    return by_slug("straight-track").geometry()


def bow(degrees=170.0, radius=2.0, width=0.8, points=40):
    """Three lines along an arc that turns left."""
    turn = np.radians(np.linspace(0.0, degrees, points))
    around = np.column_stack((np.sin(turn), -np.cos(turn)))
    return [radius * around, (radius - width / 2) * around, (radius + width / 2) * around]


BOW = TrackGeometry.from_arrays("Bow", *bow(), is_open=True)


def test_the_straight_track_is_open_and_as_long_as_its_file(straight):
    assert isinstance(straight, OpenTrack)
    assert straight.is_open and straight.finish_m == straight.length == pytest.approx(5.707, abs=5e-4)
    assert not by_slug("oval").geometry().is_open


def test_a_written_open_track_is_the_file_that_was_read(straight):
    assert write_npy(straight) == by_slug("straight-track").npy
    assert read_npy(write_npy(straight), straight.name, is_open=None) == straight


def test_an_open_track_survives_every_way_that_it_is_sent(straight):
    back = straight.in_direction("cw")
    for track in (straight, back):
        for copy in (
            pickle.loads(pickle.dumps(track)),
            TrackGeometry.from_dict(track.to_dict()),
            TrackGeometry.from_trusted_dict(track.to_dict()),
        ):
            assert copy == track and copy.is_open and copy.direction == track.direction


def test_the_way_back_starts_where_the_way_there_ended(straight):
    back = straight.in_direction("cw")
    assert back.point_at(0.0)[:2] == pytest.approx(straight.point_at(straight.length)[:2])
    assert np.array_equal(back.left, back.outer) and np.array_equal(straight.left, straight.inner)
    assert back.in_direction("ccw") == straight


def test_a_file_with_the_inner_border_on_the_right_runs_clockwise():
    centre, inner, outer = bow()
    assert TrackGeometry.from_arrays("Bow", centre, outer, inner, is_open=True).direction == "cw"


END_M = 0.03  # in a bend the road ends on the chord between its borders, not on the cross-section


@given(
    st.sampled_from([BOW, BOW.in_direction("cw"), by_slug("straight-track").geometry()]),
    st.floats(-0.1, 1.1),
    st.floats(-0.95, 0.95),
)
def test_a_placed_point_is_found_again_also_beyond_the_ends(track, share, side):
    distance = share * track.length
    left, right = track.half_widths_at(distance)
    offset = side * (left if side > 0 else right)
    x, y, heading = track.point_at(distance, offset)
    for hint in (None, track.project(*track.point_at(distance)[:2]).index):
        found = track.project(x, y, hint)
        assert found.distance == pytest.approx(distance, abs=1e-6)
        assert found.offset == pytest.approx(offset, abs=1e-6)
        assert math.remainder(found.heading - heading, math.tau) == pytest.approx(0.0, abs=1e-6)
        assert 0 <= found.index <= len(track) - 2
    beyond = max(-distance, distance - track.length) - RUN_OFF_M
    if abs(beyond) > END_M:
        assert track.on_road(x, y) == (beyond < 0.0)


def test_many_points_are_those_of_one_at_a_time():
    distances = np.linspace(-1.0, BOW.length + 1.0, 50)
    offsets = np.linspace(-0.3, 0.3, 50)
    one_by_one = [BOW.point_at(float(d), float(o))[:2] for d, o in zip(distances, offsets, strict=True)]
    assert BOW.points_at(distances, offsets) == pytest.approx(np.array(one_by_one), abs=1e-12)


def test_progress_does_not_wrap_round(straight):
    x, y, _ = straight.point_at(straight.length + 0.2)
    assert straight.project(x, y, len(straight) - 2).distance == pytest.approx(straight.length + 0.2)
    x, y, _ = straight.point_at(-0.2)
    assert straight.project(x, y, 0).distance == pytest.approx(-0.2)


def test_metres_of_later_laps_lie_on_the_same_road(straight):
    for lap in range(1, 20):
        start = lap * straight.length
        assert straight.along(start) == pytest.approx(0.0, abs=1e-9)
        assert straight.along(start + 2.5) == pytest.approx(2.5)
    assert straight.along(straight.length - 0.15) == pytest.approx(straight.length - 0.15)


def test_a_straight_has_no_corner_and_a_bow_has_one(straight):
    assert character_of(straight) == (0, 0)
    assert character_of(BOW).corners == character_of(BOW.in_direction("cw")).corners == 1


def bent(change):
    lines = bow()
    change(*lines)
    return lines


def hairpin(centre, inner, outer):
    for line in (centre, inner, outer):
        line[32:] = line[30:22:-1] + 0.05


def crossed(centre, inner, outer):
    inner[20:25], outer[20:25] = outer[20:25].copy(), inner[20:25].copy()


def aside(centre, inner, outer):
    centre *= 1.5


@pytest.mark.parametrize(
    ("lines", "code"),
    [
        (bow(points=5), "track_too_few_points"),
        (bow(degrees=60.0), "track_too_short"),
        (bow(width=0.2), "track_too_narrow"),
        (bow(degrees=359.0), "track_not_open"),
        (bow(degrees=340.0), "track_borders_cross"),  # what lies before the start lies on what comes before the end
        (bent(hairpin), "track_turns_back"),
        (bent(crossed), "track_borders_cross"),
        (bent(aside), "track_borders_apart"),
    ],
)
def test_an_impossible_open_road_is_refused_with_its_reason(lines, code):
    with pytest.raises(UserFault) as caught:
        TrackGeometry.from_arrays("Bow", *lines, is_open=True)
    assert caught.value.code == code
    assert "?" not in str(caught.value)
