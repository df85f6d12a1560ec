"""Shells as polygons, borders as curves, and text in the fonts that are there."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from evaluation.appearance.looks import DEFAULT_COLOUR, Shell
from paddock.geometry.catalogue import by_slug
from tests.videos.drawing.runs import OVAL
from videos.drawing import lettering, palette, shapes
from videos.drawing.ground import Ground, rounded_off
from videos.drawing.palette import bgr, speed_class


class TestShells:
    @pytest.mark.parametrize("shell", Shell.values)
    def test_every_shell_has_its_size_and_two_steered_wheels(self, shell):
        above, side = shapes.above(shell), shapes.side(shell)
        corners = np.concatenate([*above.body, *above.under, *(wheel for wheel, _ in above.steered)])
        length, width = np.ptp(corners, axis=0)
        assert 0.27 < length < 0.36 and 0.13 < width < 0.2
        assert len(above.steered) == 2
        (left, right) = sorted((middle for _, middle in above.steered), key=lambda middle: -middle[1])
        assert left == pytest.approx(right * (1, -1)) and left[0] > 0.05
        assert len(side.wheels) == 2 and side.body

    def test_an_unknown_shell_is_the_default_car(self):
        assert shapes.above("zeppelin").body is not None
        assert (shapes.above("zeppelin").body[0] == shapes.above("paddock").body[0]).all()

    def test_paths_become_outlines(self):
        (square, curve) = shapes.polygons("M0 0H10V10H0ZM0 0Q5 10 10 0T20 0Z")
        assert square.tolist() == [[0, 0], [10, 0], [10, 10], [0, 10]]
        assert curve[4] == pytest.approx((5, 5)) and curve[12] == pytest.approx((15, -5))

    @pytest.mark.parametrize("path", ["M0 0C1 1 2 2 3 3Z", "m1 1", "M0 0A5 5 0 0 1 3 3"])
    def test_an_unsupported_path_command_is_an_error(self, path):
        with pytest.raises(ValueError, match="not a path of"):
            shapes.polygons(path)


class TestGround:
    def test_a_smoothed_border_stays_close_to_its_points(self):
        curve = rounded_off(OVAL.outer)
        assert len(curve) > len(OVAL.outer)
        border = shapely.LinearRing(OVAL.outer)
        assert max(border.distance(shapely.Point(point)) for point in curve) <= 0.03
        assert np.isclose(curve[:, None], OVAL.outer[None]).all(axis=2).any(axis=0).all()

    def test_a_sharp_corner_stays(self):
        square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
        assert shapely.Polygon(rounded_off(square)).area == pytest.approx(16.0)

    def test_an_open_track_has_one_line_round_its_road_and_its_flag_where_it_ends(self):
        track = by_slug("straight-track").geometry()
        ground = Ground(track, 2.0)
        end = track.centre[-1]
        flag = [patch for patch in ground.around(*end) if patch.colour in (palette.SUNKEN, palette.TEXT)]
        corners = np.concatenate([patch.corners for patch in flag])
        assert len(flag) == 2 and np.abs(corners.mean(axis=0) - end).max() < 0.05
        (road,) = [patch for patch in ground.around(*track.centre[10]) if patch.colour == palette.ROAD]
        assert len(road.parts) == 1

    def test_only_nearby_ground_is_cached_and_not_for_ever(self):
        ground = Ground(OVAL, 2.0)
        here = ground.around(*OVAL.centre[0])
        assert here is ground.around(*OVAL.centre[0])
        corners = np.concatenate([patch.corners for patch in here])
        assert np.abs(corners - OVAL.centre[0]).max() < 6.0
        assert ground.around(1e4, 1e4) == []
        for number in range(200):
            ground.around(1e4 + 10 * number, 0.0)
        assert len(ground._cells) <= 64


class TestColours:
    def test_an_invalid_colour_becomes_the_default(self):
        assert bgr("#123456") == (0x56, 0x34, 0x12)
        for bad in ("red", "#12345", "", "#12345g", None):
            assert bgr(bad) == bgr(DEFAULT_COLOUR)

    def test_speeds_have_the_same_classes_as_on_maps(self):
        assert [speed_class(speed) for speed in (-1.0, 0.0, 0.7, 3.9, 9.0)] == [0, 0, 1, 5, 5]


def test_all_digits_are_equally_wide():
    assert len({lettering.advance(digit, 44) for digit in "0123456789"}) == 1
