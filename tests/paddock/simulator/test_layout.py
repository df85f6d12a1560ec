"""Boxes on a track: where they may stand, and that a seed means the same boxes for everybody, everywhere."""

import subprocess
import sys
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.files import read_npy
from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.layout import (
    BOTS_END_M,
    BOTS_START_M,
    BOX_SPACING_M,
    RANDOM_START_CLEAR_M,
    START_CLEAR_M,
    Layout,
    lay_out,
    start_places,
)
from tests.shared import CHECKOUT, SHARED, needs_shared
from tests.soak import examples

from .tracks_for_tests import hairpin, stadium

TRACK = stadium()


def avoidance(*boxes, **rules):
    return RaceRules(race_type="object_avoidance", boxes=tuple(BoxPlace(*box) for box in boxes), **rules)


def drawn(count, **rules):
    return RaceRules(race_type="object_avoidance", random_boxes=count, **rules)


def refusal(track, rules):
    with pytest.raises(UserFault) as caught:
        lay_out(track, rules)
    return caught.value


def test_a_time_trial_has_an_empty_layout():
    assert lay_out(TRACK, RaceRules()) == Layout(())


@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("lane", ["inner", "outer"])
def test_a_box_stands_mid_lane_at_its_share_of_the_lap(direction, lane):
    track = TRACK.in_direction(direction)
    (box,) = lay_out(track, avoidance((0.25, lane), direction=direction)).boxes
    assert (box.solid.x, box.solid.y, box.solid.yaw) == track.lane_centre(0.25 * track.length, lane)
    place = track.project(box.solid.x, box.solid.y)
    assert place.distance == pytest.approx(0.25 * track.length)
    # The inner lane lies on the left when driven counter-clockwise, on the right when driven clockwise.
    assert (place.offset > 0) == ((lane == "inner") == (direction == "ccw"))
    assert abs(place.offset) == pytest.approx(0.25)


def test_boxes_are_listed_in_driving_order():
    boxes = lay_out(TRACK, avoidance((0.7, "inner"), (0.2, "outer"), (0.45, "inner"))).boxes
    assert [box.fraction for box in boxes] == [0.2, 0.45, 0.7]
    assert [box.lane for box in boxes] == ["outer", "inner", "inner"]


@pytest.mark.parametrize("metres", [0.0, 0.99, TRACK.length - 0.99])
def test_a_box_on_the_start_line_is_refused(metres):
    fault = refusal(TRACK, avoidance((0.5, "inner"), (metres / TRACK.length, "outer")))
    assert (fault.code, fault.params) == ("box_on_start_line", {"number": 2, "least_m": START_CLEAR_M})


@pytest.mark.parametrize("lanes", [("inner", "inner"), ("inner", "outer")])
def test_boxes_that_together_block_the_road_are_refused(lanes):
    apart = 0.98 * BOX_SPACING_M / TRACK.length
    fault = refusal(TRACK, avoidance((0.05 + apart + 0.1, lanes[0]), (0.15, lanes[1])))
    assert fault.code == "boxes_overlap"
    assert (fault.params["number"], fault.params["other"]) == (1, 2)
    assert lay_out(TRACK, avoidance((0.15, lanes[0]), (0.15 + 1.05 * BOX_SPACING_M / TRACK.length, lanes[1])))


def test_boxes_on_parallel_parts_of_a_track_may_not_overlap():
    track = hairpin()
    beside = track.project(1.0, 0.3).distance / track.length  # the straight back, 0.64 m beside the one out
    fault = refusal(track, avoidance((1.0 / track.length + 0.02, "inner"), (beside - 0.02, "inner")))
    assert fault.code == "boxes_overlap"


def test_a_box_that_no_car_can_pass_is_refused():
    narrow = stadium(width=0.5)
    fault = refusal(narrow, avoidance((0.3, "inner")))
    assert (fault.code, fault.params["number"]) == ("box_off_track", 1)
    assert fault.params["width_m"] == pytest.approx(0.5, abs=0.01)
    assert lay_out(stadium(width=0.6), avoidance((0.3, "inner")))


def test_too_many_random_boxes_for_the_track_are_refused():
    fault = refusal(TRACK, drawn(10, box_distance_m=2.0))
    assert fault.code == "boxes_do_not_fit"
    assert fault.params == {"boxes": 10, "distance_m": 2.0, "length_m": round(TRACK.length, 2)}
    assert refusal(stadium(width=0.5), drawn(1)).code == "boxes_do_not_fit"


def test_bots_start_apart_and_off_the_grid_or_are_refused():
    places = start_places(TRACK.length, 4)
    assert places[0] >= BOTS_START_M and places[-1] <= TRACK.length - BOTS_END_M
    assert min(b - a for a, b in pairwise(places)) >= 2.0
    fault = refusal(stadium(straight=2.0), RaceRules(race_type="head_to_head", bots=6))
    assert (fault.code, fault.params["bots"]) == ("bots_do_not_fit", 6)


def test_six_bots_have_room_on_every_catalogue_track():
    for entry in [entry for entry in CATALOGUE if not entry.is_open]:
        assert len(start_places(entry.geometry().length, 6)) == 6


@given(length=st.floats(5.0, 100.0), bots=st.integers(1, 6))
def test_bots_fit_where_they_can_start_2_m_apart(length, bots):
    room = length - BOTS_START_M - BOTS_END_M
    try:
        places = start_places(length, bots)
    except UserFault as fault:
        assert fault.code == "bots_do_not_fit" and room < 2.0 * (bots - 1)
        return
    assert len(places) == bots and places[0] == BOTS_START_M and places[-1] <= length - BOTS_END_M + 1e-9
    assert all(b - a >= 2.0 - 1e-9 for a, b in pairwise(places))


@needs_shared
def test_six_bots_have_room_on_the_shortest_official_track():
    track = read_npy((SHARED / "tracks" / "reInvent2019_wide.npy").read_bytes(), "reInvent2019_wide")
    assert len(start_places(track.length, 6)) == 6


@given(seed=st.integers(0, 10**9), count=st.integers(1, 6), distance=st.floats(0.0, 2.2))
@settings(max_examples=examples(150), deadline=None)
def test_random_boxes_keep_their_distance_and_the_start_free(seed, count, distance):
    rules = drawn(count, seed=seed, box_distance_m=distance)
    boxes = lay_out(TRACK, rules).boxes
    assert len(boxes) == count
    metres = [box.metres for box in boxes]
    assert metres[0] >= RANDOM_START_CLEAR_M - 1e-3 and metres[-1] <= TRACK.length - START_CLEAR_M
    after = [*metres[1:], metres[0] + TRACK.length]
    assert min(b - a for a, b in zip(metres, after, strict=True)) >= max(distance, BOX_SPACING_M) or count == 1
    # What was drawn can be written down as fixed places and gives the same layout.
    fixed = avoidance(*((box.fraction, box.lane) for box in boxes))
    assert lay_out(TRACK, fixed) == lay_out(TRACK, rules)


def test_a_wide_distance_holds_across_the_finish_line():
    for seed in range(200):
        first, second, third = (box.metres for box in lay_out(TRACK, drawn(3, seed=seed, box_distance_m=4.5)).boxes)
        assert min(second - first, third - second, first + TRACK.length - third) >= 4.5


def test_each_seed_gives_its_own_layout():
    layouts = {lay_out(TRACK, drawn(4, seed=seed)) for seed in range(50)}
    assert len(layouts) == 50
    assert {box.lane for layout in layouts for box in layout.boxes} == {"inner", "outer"}
    assert lay_out(TRACK, drawn(4, seed=7)) == lay_out(TRACK, drawn(4, seed=7))


def test_a_seed_gives_the_same_boxes_in_every_process():
    expected = [(0.406151, "outer"), (0.620561, "outer"), (0.899156, "outer")]
    code = (
        "from tests.paddock.simulator.test_layout import TRACK, drawn, lay_out;"
        "print([(box.fraction, box.lane) for box in lay_out(TRACK, drawn(3, seed=42)).boxes])"
    )
    for hash_seed in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=CHECKOUT,
            env={"PYTHONHASHSEED": hash_seed, "PATH": "/usr/bin:/bin"},
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        assert done.stdout.strip() == str(expected)


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_every_catalogue_track_has_room_for_six_random_boxes(entry, direction):
    track = entry.geometry().in_direction(direction)
    for seed in range(20):
        boxes = lay_out(track, drawn(6, seed=seed, direction=direction)).boxes
        assert len(boxes) == 6
        assert all(track.on_road(box.solid.x, box.solid.y) for box in boxes)


def test_a_layout_is_plain_json_to_a_millimetre():
    (box,) = lay_out(TRACK, avoidance((0.3, "outer"))).boxes
    assert Layout((box,)).to_dict() == {
        "boxes": [
            {
                "fraction": 0.3,
                "lane": "outer",
                "x": round(box.solid.x, 3),
                "y": round(box.solid.y, 3),
                "yaw": round(box.solid.yaw, 3),
            }
        ]
    }
