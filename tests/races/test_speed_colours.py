"""The colours of a driven line: from the slowest to the fastest speed of the run."""

from __future__ import annotations

from races.replays.run_maps import ColourBy, speed_scale, trajectories
from tracks.drawing.maps import SPEED_CLASSES


def test_the_scale_fits_the_speeds_of_the_run():
    line = [[(0.01 * step, 0.0, 1.2 + 0.004 * step) for step in range(100)]]
    assert speed_scale(line) == (1.2, 1.6)
    classes = [number for number, _points in trajectories(line, ColourBy.SPEED)[0].strokes()]
    assert classes == list(range(SPEED_CLASSES)), "every colour is used between 1.2 and 1.6 m/s"


def test_a_standing_start_is_the_slowest_colour_and_no_line_has_the_full_scale():
    assert speed_scale([[(0.0, 0.0, 0.0), (0.1, 0.0, 2.0), (0.2, 0.0, 3.0)]]) == (2.0, 3.0)
    assert speed_scale([[]]) == (0.0, 4.0)
