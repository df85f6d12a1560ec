"""Maps as SVG."""

import itertools
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.character import character_of
from paddock.geometry.track import TrackGeometry
from tests.soak import examples
from tracks.drawing.maps import ERROR_M, SPEED_CLASSES, BoxMark, Trajectory, draw_svg, simplify, simplify_loop, svg_path

SVG = "{http://www.w3.org/2000/svg}"
every_track = pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)


def lap(track, offset=0.2, step=0.2):
    return [track.point_at(k * step, offset)[:2] for k in range(int(track.length / step))]


def drawn(picture, word):
    root = ET.fromstring(picture)
    return [part for part in root.iter() if word in part.get("class", "").split()]


def points_of(path):
    return [tuple(map(float, pair.split(","))) for pair in re.findall(r"-?[\d.]+,-?[\d.]+", path.get("d"))]


@every_track
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_map_is_xml_with_all_marks_inside_its_frame(entry, direction):
    track = entry.geometry(direction)
    picture = draw_svg(track, width=320, lines=[Trajectory(lap(track))])
    root = ET.fromstring(picture)
    assert (root.get("width"), root.get("height"), root.get("role")) == ("320", None, "img")
    assert root[0].tag == SVG + "title" and root[0].text == entry.name
    _, _, width, height = map(float, root.get("viewBox").split())
    x_min, y_min, x_max, y_max = track.bounds
    assert width == pytest.approx(x_max - x_min + 0.6, abs=0.01)
    assert height == pytest.approx(y_max - y_min + 0.6, abs=0.01)
    for word in ("track-road", "track-kerb", "track-centre", "track-line", "track-finish", "track-arrow"):
        (path,) = drawn(picture, word)
        assert all(0 <= x <= width and 0 <= y <= height for x, y in points_of(path)), word
    assert len(picture) < 16_000
    assert "style" not in picture and "#" not in picture, "colours belong to the style sheet"


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_a_map_of_an_open_track_has_a_start_and_a_finish(direction):
    track = by_slug("straight-track").geometry(direction)
    picture = draw_svg(track, lanes=True)
    (road,) = drawn(picture, "track-road")
    assert road.get("d").count("Z") == 1  # one line round the road, not a ring
    (start,), (finish,) = drawn(picture, "track-start"), drawn(picture, "track-finish")
    apart = np.mean(points_of(finish), axis=0) - np.mean(points_of(start), axis=0)
    assert apart == pytest.approx([5.71 if direction == "ccw" else -5.71, 0.0], abs=0.02)
    for word in ("track-centre", "track-lane"):
        assert all(not line.get("d").endswith("Z") for line in drawn(picture, word))
    assert not drawn(draw_svg(by_slug("oval").geometry()), "track-start")


def test_a_callers_marks_lie_on_the_road_with_room_below():
    track = by_slug("oval").geometry()
    plain = ET.fromstring(draw_svg(track))
    picture = ET.fromstring(draw_svg(track, marks='<path class="mine"/>', below_m=1.5))
    classes = [part.get("class") for part in picture]
    assert classes.index("mine") > classes.index("track-road")
    *_, height = map(float, plain.get("viewBox").split())
    *_, taller = map(float, picture.get("viewBox").split())
    assert taller == pytest.approx(height + 1.5, abs=0.01)


def test_the_arrow_points_in_the_driving_direction():
    for entry in CATALOGUE[:7]:
        for direction in ("ccw", "cw"):
            track = entry.geometry(direction)
            (path,) = drawn(draw_svg(track), "track-arrow")
            tail, tip, _ = points_of(path)
            _, _, heading = track.point_at(0.0)
            # a picture's y points down
            assert (tip[0] - tail[0]) * math.cos(heading) - (tip[1] - tail[1]) * math.sin(heading) > 0


def test_the_finish_line_spans_the_road_at_waypoint_0():
    track = CATALOGUE[0].geometry()
    (path,) = drawn(draw_svg(track), "track-finish")
    one, other = points_of(path)
    assert math.dist(one, other) == pytest.approx(1.07, abs=0.02)
    assert svg_path(track, [track.left[0], track.right[0]]) == path.get("d")


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_kerbs_lie_on_the_inner_border_of_the_turns(direction):
    track = by_slug("kuei-raceway").geometry(direction)
    (kerbs,) = drawn(draw_svg(track), "track-kerb")
    x_min, _, _, y_max = track.bounds
    pieces = kerbs.get("d").split("M")[1:]
    assert len(pieces) == character_of(track).corners
    sides = []
    for piece in pieces:
        points = [tuple(map(float, pair.split(","))) for pair in piece.split()]
        for x, y in points:
            place = track.project(x + x_min - 0.3, y_max + 0.3 - y)
            left, right = track.half_widths_at(place.distance)
            assert place.offset == pytest.approx(left if place.offset > 0 else -right, abs=0.03)
        before, after = (track.project(x + x_min - 0.3, y_max + 0.3 - y) for x, y in (points[0], points[-1]))
        turned = math.remainder(after.heading - before.heading, math.tau)
        assert (turned > 0) == (before.offset > 0), "on the side that the road turns to"
        sides.append(before.offset > 0)
    assert {True, False} == set(sides)


HOSTILE = "</title><script>alert(1)</script>&amp;\"'\x00\x1b\ud800\uffff]]>"


def test_a_hostile_name_stays_text():
    source = CATALOGUE[0].geometry()
    track = TrackGeometry.from_arrays(HOSTILE, source.centre, source.inner, source.outer)
    for picture in (draw_svg(track), draw_svg(source, title=HOSTILE)):
        root = ET.fromstring(picture.encode())
        assert [part.tag for part in root.iter() if "script" in part.tag] == []
        assert root[0].text == "</title><script>alert(1)</script>&amp;\"']]>"


@settings(max_examples=examples(100), deadline=None)
@given(st.text())
def test_any_name_gives_parseable_xml(name):
    root = ET.fromstring(draw_svg(by_slug("oval").geometry(), title=name).encode())
    assert len(root) >= 5 and root[0].tag == SVG + "title"


def test_a_trajectorys_style_cannot_escape_its_attribute():
    assert drawn(draw_svg(CATALOGUE[0].geometry(), lines=[Trajectory([(0, 0), (0, 0.1)], style="rival-2")]), "rival-2")
    for style in ('"><script>', "two words", "ü", "a;b"):
        with pytest.raises(ValueError, match="style"):
            Trajectory([(0, 0), (1, 1)], style=style)


def test_a_trajectory_is_coloured_by_speed_without_gaps():
    track = CATALOGUE[0].geometry()
    points = lap(track)
    speeds = np.linspace(0.0, 4.5, len(points))
    strokes = Trajectory(points, speeds).strokes()
    assert [speed for speed, _ in strokes] == list(range(SPEED_CLASSES))
    for (_, before), (_, after) in itertools.pairwise(strokes):
        assert np.array_equal(before[-1], after[0])
    picture = draw_svg(track, lines=[Trajectory(points, speeds)])
    assert len(drawn(picture, "track-line")) == SPEED_CLASSES
    assert len(drawn(picture, "speed-5")) == 1
    with pytest.raises(ValueError, match="speeds"):
        Trajectory(points, speeds[:-1])


def test_a_reset_breaks_the_trajectory():
    line = Trajectory([(0, 0), (0.2, 0), (0.4, 0), (3.0, 0), (3.2, 0), (9.0, 0), (math.nan, 0), (9.4, 0), (9.6, 0)])
    strokes = [points.tolist() for _, points in line.strokes()]
    assert strokes == [[[0, 0], [0.4, 0]], [[3, 0], [3.2, 0]], [[9.4, 0], [9.6, 0]]]
    assert Trajectory([]).strokes() == [] and Trajectory([(1, 1)]).strokes() == []


@every_track
def test_thinning_stays_within_its_error(entry):
    track = entry.geometry()
    points = np.array(lap(track, step=0.05))
    thin = simplify(points)
    assert len(thin) < len(points) / 3
    assert np.array_equal(thin[0], points[0]) and np.array_equal(thin[-1], points[-1])
    loop = simplify_loop(track.outer)
    assert np.array_equal(loop[0], track.outer[0]) and len(loop) < len(track) * 0.8
    for full, few in ((points, thin), (track.outer, np.vstack((loop, loop[:1])))):
        a, step = few[:-1], np.diff(few, axis=0)
        apart = full[:, None] - a[None]
        t = np.clip((apart * step).sum(2) / (step * step).sum(1), 0, 1)
        off = np.linalg.norm(apart - t[..., None] * step, axis=2).min(axis=1)
        assert off.max() <= ERROR_M + 1e-12


def test_a_standalone_map_carries_its_style():
    picture = draw_svg(CATALOGUE[0].geometry(), standalone=True)
    assert ET.fromstring(picture).find(SVG + "style") is not None


def test_a_map_shows_boxes_in_place_with_number_and_title():
    track = by_slug("oval").geometry()
    boxes = [
        BoxMark(*track.lane_centre(4.0, "inner"), 0.15, 0.2, 1, "first <box>"),
        BoxMark(*track.lane_centre(9.0, "outer"), 0.15, 0.2),
    ]
    picture = draw_svg(track, boxes=boxes)
    first, second = drawn(picture, "track-box")
    assert first.find(f"{SVG}title").text == "first <box>" and first.find(f"{SVG}text").text == "1"
    assert second.find(f"{SVG}title") is None and second.find(f"{SVG}text") is None
    x_min, _, _, y_max = track.bounds
    for box, group in zip(boxes, (first, second), strict=True):
        corners = points_of(group.find(f"{SVG}path"))
        assert len(corners) == 4
        middle = np.mean(corners, axis=0)
        assert middle == pytest.approx((box.x - x_min + 0.3, y_max + 0.3 - box.y), abs=0.02)
        assert math.dist(corners[0], corners[1]) == pytest.approx(0.3, rel=0.05), "true to scale on a small track"


def test_a_box_stays_visible_on_the_map_of_a_long_track():
    track = by_slug("kuei-super-raceway").geometry()
    picture = draw_svg(track, boxes=[BoxMark(*track.lane_centre(20.0, "inner"), 0.15, 0.2)])
    corners = points_of(drawn(picture, "track-box")[0].find(f"{SVG}path"))
    x_min, y_min, x_max, y_max = track.bounds
    assert math.dist(corners[0], corners[1]) > 0.025 * max(x_max - x_min, y_max - y_min)


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_lanes_are_drawn_on_their_side_in_either_direction(direction):
    track = by_slug("oval").geometry().in_direction(direction)
    assert not drawn(draw_svg(track), "track-lane")
    length = {}
    for path in drawn(draw_svg(track, lanes=True), "track-lane"):
        points = points_of(path)
        length[path.get("class")] = sum(math.dist(a, b) for a, b in zip(points, [*points[1:], points[0]], strict=True))
    assert length["track-lane inner"] < track.length < length["track-lane outer"]
