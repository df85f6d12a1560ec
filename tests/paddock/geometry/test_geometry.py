"""Projection, placing, widths and directions of a track."""

import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import WINDOW_M, TrackGeometry
from tests.soak import examples

tracks = st.sampled_from([entry for entry in CATALOGUE if not entry.is_open])
directions = st.sampled_from(("ccw", "cw"))
# Over so many metres of the centre line cross-sections may meet within the road, on the inside of a hairpin
HAIRPIN_M = 1.5
INEXACT_M = {"kuei-raceway": 0.2, "kuei-super-raceway": 0.2}
shares = st.floats(0, 1, exclude_max=True)
sides = st.floats(-0.999, 0.999)


def ring(radius=3.0, width=1.0, points=120, name="ring"):
    """A circular track: everything about it is known exactly in the limit of many points."""
    angle = np.arange(points) * math.tau / points
    unit = np.column_stack((np.cos(angle), np.sin(angle)))
    return TrackGeometry.from_arrays(name, radius * unit, (radius - width / 2) * unit, (radius + width / 2) * unit)


def apart(track, one, other):
    """Metres between two distances along the track, the short way round."""
    return abs((one - other + track.length / 2) % track.length - track.length / 2)


def turned(one, other):
    return abs(math.remainder(one - other, math.tau))


@settings(max_examples=examples(400), deadline=None)
@given(tracks, directions, shares, sides)
def test_projecting_a_placed_point_recovers_its_place(entry, direction, share, side):
    track = entry.geometry(direction)
    distance = share * track.length
    left, right = track.half_widths_at(distance)
    offset = side * (left if side > 0 else right)
    x, y, heading = track.point_at(distance, offset)
    hint = int(np.searchsorted(track.cumulative, distance, side="right")) - 1
    for found in (track.project(x, y), track.project(x, y, hint), track.project(x, y, hint + 3)):
        # Inside a hairpin cross-sections meet, and a point has more than one place; on the tightest not even exactly
        assert math.dist(track.point_at(found.distance, found.offset)[:2], (x, y)) < INEXACT_M.get(entry.slug, 1e-6)
        if apart(track, found.distance, distance) < 1e-6:
            assert found.offset == pytest.approx(offset, abs=1e-6)
            assert turned(found.heading, heading) < 1e-4
        else:
            assert apart(track, found.distance, distance) < HAIRPIN_M
        assert 0 <= found.distance < track.length
        assert 0 <= found.index < len(track)
    # On the outside of a bend the chord between two border points cuts off up to a sixth of the half width
    assert track.on_road(*track.point_at(distance, 0.83 * offset)[:2])


@settings(max_examples=examples(200), deadline=None)
@given(tracks, shares, sides)
def test_both_directions_agree_on_where_a_point_is(entry, share, side):
    ccw, cw = entry.geometry("ccw"), entry.geometry("cw")
    x, y, _ = ccw.point_at(share * ccw.length, side * ccw.half_widths_at(share * ccw.length)[0])
    one, other = ccw.project(x, y), cw.project(x, y)
    assert apart(ccw, one.distance, -other.distance) < 1e-6
    assert one.offset == pytest.approx(-other.offset, abs=1e-6)
    assert turned(one.heading, other.heading + math.pi) < 1e-4
    assert ccw.width_at(one.distance) == pytest.approx(cw.width_at(other.distance), abs=1e-5)
    for lane in ("inner", "outer"):
        ours, theirs = ccw.lane_centre(one.distance, lane), cw.lane_centre(other.distance, lane)
        assert math.dist(ours[:2], theirs[:2]) < 1e-4


@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_progress_never_jumps_on_a_wobbling_lap(entry, direction):
    track = entry.geometry(direction)
    hint, before, total = 0, 0.0, 0.0
    # near a border, the inside of Kuei's hairpins of few waypoints is folded: two distances for one point
    sway_m = 0.4 if entry.slug.startswith("kuei") else 0.53
    steps = int(track.length / 0.05)
    for k in range(1, 2 * steps + 1):
        distance = k * track.length / steps
        x, y, _ = track.point_at(distance, sway_m * math.sin(1.7 * distance))
        found = track.project(x, y, hint)
        moved = math.remainder(found.distance - before, track.length)
        assert 0.0 < moved < 0.2
        total += moved
        hint, before = found.index, found.distance
        assert found == track.project(x, y, hint)
    assert total == pytest.approx(2 * track.length, abs=1e-6)


@settings(max_examples=examples(200), deadline=None)
@given(tracks, directions, shares, st.floats(-1.5, 1.5), st.floats(0, math.tau))
def test_a_straying_cars_progress_stays_within_the_window(entry, direction, share, offset, angle):
    """A car beside the road next to another part of the track is still where it came from."""
    track = entry.geometry(direction)
    start = track.project(*track.point_at(share * track.length, 0.0)[:2])
    x, y, _ = track.point_at(start.distance, offset)
    found = track.project(x + 0.2 * math.cos(angle), y + 0.2 * math.sin(angle), start.index)
    # the window is counted in whole segments: one more is entered at its edge, and the start lies within one
    segment_m = float(np.diff(track.cumulative, append=track.length).max())
    assert apart(track, found.distance, start.distance) <= WINDOW_M + 2 * segment_m
    again = track.project(x + 0.2 * math.cos(angle), y + 0.2 * math.sin(angle), start.index)
    assert found == again


def test_the_hint_tells_parallel_parts_apart():
    track = next(entry for entry in CATALOGUE if entry.slug == "aws-summit-raceway").geometry()
    onto, back = 0.25, 7.75  # before and after the hairpin
    x, y, _ = track.point_at(onto, 0.9)  # between the two straights, nearer to the way back
    assert apart(track, track.project(x, y).distance, back) < 1.5
    hint = track.project(*track.point_at(onto)[:2]).index
    assert apart(track, track.project(x, y, hint).distance, onto) < 0.1


@settings(max_examples=examples(100), deadline=None)
@given(tracks, st.floats(-30, 30), st.floats(-30, 30))
def test_without_a_hint_shapelys_nearest_part_counts(entry, x, y):
    shapely = pytest.importorskip("shapely", reason="the oracle comes with deepracer-utils")
    track = entry.geometry()
    line = shapely.LinearRing(track.centre)
    truth = line.distance(shapely.Point(x, y))
    found = track.project(x, y)
    assert truth - 1e-9 <= abs(found.offset) <= 1.2 * truth + 0.03
    assert math.dist(track.point_at(found.distance)[:2], (x, y)) <= 1.2 * truth + 0.03


@settings(max_examples=examples(300), deadline=None)
@given(tracks, shares, st.floats(-1.2, 1.2))
def test_on_road_agrees_with_shapely(entry, share, offset):
    shapely = pytest.importorskip("shapely", reason="the oracle comes with deepracer-utils")
    track = entry.geometry()
    x, y, _ = track.point_at(share * track.length, offset)
    road = shapely.Polygon(track.outer, [track.inner])
    if road.boundary.distance(shapely.Point(x, y)) > 1e-7:
        assert track.on_road(x, y) == road.contains(shapely.Point(x, y))


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_border_lines_belong_to_the_road(entry):
    track = entry.geometry()
    for border in (track.inner, track.outer):
        after = np.roll(border, -1, axis=0)
        for share in (0.0, 0.3, 0.5):
            assert all(track.on_road(x, y) for x, y in (border + share * (after - border)).tolist())


def test_far_and_non_finite_points_are_off_the_road():
    track = ring()
    for x, y in ((0, 0), (9, 0), (0, 9), (0, -9), (math.nan, 0), (3, math.inf), (-math.inf, math.nan)):
        assert not track.on_road(x, y)


def test_a_circular_track_has_the_measures_of_a_circle():
    track = ring(radius=3.0, points=720)
    assert track.length == pytest.approx(math.tau * 3, rel=1e-4)
    assert track.direction == "ccw"
    found = track.project(0.0, 2.7)
    assert found.distance == pytest.approx(math.tau * 3 / 4, rel=1e-4)
    assert found.offset == pytest.approx(0.3, abs=1e-3)
    assert turned(found.heading, math.pi) < 1e-2
    assert track.width_at(5.0) == pytest.approx(1.0, abs=1e-4)
    assert track.lane_centre(0.0, "inner")[:2] == pytest.approx((2.75, 0.0), abs=1e-4)
    assert track.lane_centre(0.0, "outer")[:2] == pytest.approx((3.25, 0.0), abs=1e-4)
    assert track.bounds == pytest.approx((-3.5, -3.5, 3.5, 3.5))
    backwards = track.in_direction("cw")
    assert backwards.project(0.0, 2.7).offset == pytest.approx(-0.3, abs=1e-3)
    assert backwards.lane_centre(0.0, "inner")[:2] == pytest.approx((2.75, 0.0), abs=1e-4)


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_vectorised_points_are_bit_identical(entry):
    track = entry.geometry()
    random = np.random.default_rng(3)
    distances = np.concatenate((random.uniform(-2, 3, 300) * track.length, track.cumulative, [0.0, track.length]))
    offsets = random.uniform(-1, 1, len(distances))
    one_by_one = [track.point_at(d, o)[:2] for d, o in zip(distances.tolist(), offsets.tolist(), strict=True)]
    assert (track.points_at(distances, offsets) == one_by_one).all()
    assert (track.points_at(distances) == [track.point_at(d)[:2] for d in distances.tolist()]).all()
    widths = np.array([track.half_widths_at(d) for d in distances.tolist()])
    assert (np.column_stack(track.half_widths_along(distances)) == widths).all()


def test_distance_wraps_both_ways():
    track = ring()
    assert track.point_at(track.length + 1.0) == pytest.approx(track.point_at(1.0))
    assert track.point_at(-1.0) == pytest.approx(track.point_at(track.length - 1.0))
    assert track.point_at(-1e-18) == pytest.approx(track.point_at(0.0))
    assert track.width_at(-0.5) == pytest.approx(track.width_at(track.length - 0.5))


@pytest.mark.parametrize("hint", [None, 0])
@pytest.mark.parametrize("point", [(math.nan, 0.0), (0.0, math.inf)])
def test_a_non_finite_point_cannot_be_projected(point, hint):
    with pytest.raises(ValueError, match="not finite"):
        ring().project(*point, hint)
    with pytest.raises(ValueError, match="finite"):
        ring().point_at(math.nan)


def test_reversing_keeps_the_finish_line_and_the_borders():
    track = CATALOGUE[0].geometry("ccw")
    back = track.in_direction("cw")
    assert back.direction == "cw"
    assert np.array_equal(back.centre[0], track.centre[0])
    assert np.array_equal(back.inner[1], track.inner[-1])
    assert np.array_equal(track.left, track.inner) and np.array_equal(track.right, track.outer)
    assert np.array_equal(back.left, back.outer) and np.array_equal(back.right, back.inner)
    assert back.length == pytest.approx(track.length)
    assert back.in_direction("ccw") == track
    assert track.in_direction("ccw") is track
    with pytest.raises(ValueError, match="direction"):
        track.in_direction("clockwise")
    with pytest.raises(ValueError, match="lane"):
        track.lane_centre(0.0, "left")


def test_a_track_is_immutable():
    track = CATALOGUE[0].geometry()
    for line in (track.centre, track.inner, track.outer, track.left, track.right, track.cumulative):
        assert line.flags.c_contiguous and line.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            line[0] = 0.0
    with pytest.raises(AttributeError):
        track.length = 1.0
    with pytest.raises(AttributeError):
        del track.length


def test_changing_the_callers_arrays_does_not_change_a_track():
    source = ring()
    centre, inner, outer = (np.array(line) for line in (source.centre, source.inner, source.outer))
    track = TrackGeometry.from_arrays("copy", centre, inner, outer)
    print_before = track.fingerprint
    centre += 1.0
    assert track.fingerprint == print_before


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_a_track_survives_json_and_pickle_bit_for_bit(entry):
    track = entry.geometry("cw")
    sent = json.loads(json.dumps(track.to_dict()))
    for other in (
        TrackGeometry.from_dict(sent),
        TrackGeometry.from_trusted_dict(sent),
        pickle.loads(pickle.dumps(track)),
    ):
        assert other == track and hash(other) == hash(track)
        assert other.fingerprint == track.fingerprint
        assert other.project(1.0, 2.0) == track.project(1.0, 2.0)
        assert not other.centre.flags.writeable
    assert track != entry.geometry("ccw")
    assert len(track) == len(track.centre)


def test_swapped_borders_are_put_right():
    source = ring()
    track = TrackGeometry.from_arrays("swapped", source.centre, source.outer, source.inner)
    assert np.array_equal(track.inner, source.inner)


def test_duplicate_points_and_the_closing_row_are_dropped():
    source = ring(points=40)
    rows = [0, 0, *range(40), 39, 0, 0]
    track = TrackGeometry.from_arrays("ring", source.centre[rows], source.inner[rows], source.outer[rows])
    assert track == source
