"""Tracks as CSV: centre lines with widths, of F1TENTH and of the TUM racetrack database, and what is refused."""

from __future__ import annotations

import math
import time
import warnings

import numpy as np
import pytest

from paddock.errors import UserFault
from paddock.geometry.character import median_width
from paddock.geometry.files import MAX_BYTES, read_track, write_npy
from tests.shared import SHARED, needs_shared

ANGLES = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
F1TENTH = "# x_m, y_m, w_tr_right_m, w_tr_left_m"
TUM_RACELINE = "# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"


def oval(size: float = 1.0, shift: float = 0.0) -> list[tuple[float, float]]:
    return [(shift + 8.0 * size * np.cos(a), shift + 5.0 * size * np.sin(a)) for a in ANGLES]


def table(
    points, right: float = 0.5, left: float = 0.7, *, heading: str = F1TENTH, mark: str = ", ", end: str = "\n"
) -> bytes:
    rows = [mark.join(f"{value:.4f}" for value in (x, y, right, left)) for x, y in points]
    return end.join([*([heading] if heading else []), *rows, ""]).encode()


def refused(data: bytes, **options) -> UserFault:
    with pytest.raises(UserFault) as caught:
        read_track(data, "made", **options)
    assert len(str(caught.value).split(". ")) > 1 or ":" in str(caught.value), "no next step"
    return caught.value


@needs_shared
def test_the_shared_centre_line_is_a_track():
    track = read_track((SHARED / "failing" / "15-centreline.csv").read_bytes(), "oval")
    assert median_width(track) == pytest.approx(1.1, abs=0.01)
    assert track.direction == "ccw"


@pytest.mark.parametrize(
    "data",
    [
        table(oval()),
        table(oval(), heading="x_m,y_m,w_tr_right_m,w_tr_left_m"),
        table(oval(), heading=""),
        table(oval(), heading="", mark=" "),
        table(oval(), heading="", mark="\t"),
        table(oval(), mark="; ", heading="# x_m; y_m; w_tr_right_m; w_tr_left_m"),
        table(oval(), end="\r\n"),
        b"\xef\xbb\xbf" + table(oval()),
        b"# made by hand\n\n" + table(oval()),
        table(oval(), mark=";", heading="").replace(b".", b","),
        table(oval(), 0.7, 0.5, heading="x_m,y_m,w_tr_left_m,w_tr_right_m"),
    ],
)
def test_forms_of_a_table(data):
    track = read_track(data, "made")
    assert median_width(track) == pytest.approx(1.2, abs=0.01)
    assert track.length == pytest.approx(41.4, abs=0.3)
    left, right = track.half_widths_along(track.cumulative)
    assert (float(np.median(left)), float(np.median(right))) == pytest.approx((0.7, 0.5), abs=0.02)


def test_a_clockwise_line_has_its_left_border_outside():
    track = read_track(table(oval()[::-1]), "made")
    left, right = track.half_widths_along(track.cumulative)
    assert track.direction == "cw"
    assert (float(np.median(left)), float(np.median(right))) == pytest.approx((0.7, 0.5), abs=0.02)


def test_a_circuit_of_full_size_is_scaled():
    data = table(oval(size=100.0, shift=500_000.0), 5.0, 5.0)
    assert refused(data).code == "track_too_long"
    assert float(refused(data).params["scale"]) == pytest.approx(0.95 * 1000 / 4140, rel=0.1)
    track = read_track(data, "made", scale=0.1)
    assert track.length == pytest.approx(414.0, abs=3.0)
    assert median_width(track) == pytest.approx(1.0, abs=0.01)
    assert median_width(read_track(data, "made", scale=0.1, least_width_m=1.4)) == pytest.approx(1.4, abs=0.01)


def test_a_race_line_without_widths_takes_the_least_width():
    rows = [f"{0.1 * n:.3f}; {x:.4f}; {y:.4f}; 0; 0; 8.0; 0" for n, (x, y) in enumerate(oval())]
    data = "\n".join(["# 7c0e9", "# another comment", TUM_RACELINE, *rows]).encode()
    assert refused(data).code == "track_csv_widths"
    assert median_width(read_track(data, "made", least_width_m=1.0)) == pytest.approx(1.0, abs=0.01)


def test_many_points_are_thinned():
    angles = np.linspace(0.0, 2.0 * np.pi, 9000, endpoint=False)
    track = read_track(table([(80.0 * np.cos(a), 60.0 * np.sin(a)) for a in angles]), "made")
    assert len(track.centre) <= 2000


def test_exchanged_widths_are_recognised():
    """Two straights one metre apart leave no 0.8 m on the inside."""
    there = [(x, -0.5) for x in np.arange(0.0, 6.0, 0.2)]
    bend = [(6.0 + 0.5 * np.sin(a), -0.5 * np.cos(a)) for a in np.linspace(0.0, np.pi, 12)]
    line = [*there, *bend, *[(6.0 - x, -y) for x, y in there], *[(6.0 - x, -y) for x, y in bend]]
    track = read_track(table(line, 0.3, 0.8), "made")
    left, right = track.half_widths_along(track.cumulative)
    assert (float(np.median(left)), float(np.median(right))) == pytest.approx((0.3, 0.8), abs=0.02)


def test_exchanged_borders_of_a_numpy_file_are_recognised():
    right = read_track(table(oval()), "made")
    rows = np.hstack((right.centre, right.outer, right.inner))
    text = "\n".join(",".join(f"{value:.12f}" for value in row) for row in rows).encode()
    exchanged = read_track(text, "made")
    assert np.allclose(exchanged.inner, right.inner)
    assert read_track(write_npy(right), "made").fingerprint == right.fingerprint


def test_a_numpy_file_is_scaled_and_widened():
    data = write_npy(read_track(table(oval()), "made"))
    assert median_width(read_track(data, "made", scale=2.0)) == pytest.approx(2.4, abs=0.02)
    assert median_width(read_track(data, "made", least_width_m=1.5)) == pytest.approx(1.5, abs=0.02)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"hello", "track_not_npy"),
        (b"a,b\nc,d\n", "track_not_npy"),
        (table(oval()) + b"1.0, 2.0\n", "track_csv_row"),
        (table(oval()) + b"1.0, x, 0.5, 0.5\n", "track_csv_row"),
        (b"# a, b, c\n" + b"1, 2, 3\n" * 20, "track_csv_columns"),
        (table(oval(), -0.5), "track_csv_negative"),
        (table(oval(), heading="").replace(b"8.0000", b"nan", 1), "track_not_finite"),
        (table(oval(), 0.05, 0.05), "track_too_narrow"),
        (table(oval(), 3.0, 3.0), "track_too_wide"),
        (table(oval(size=0.05), 0.2, 0.2), "track_too_short"),
        (table(oval()[:60]), "track_open"),
    ],
)
def test_what_is_refused_names_the_next_step(data, code):
    assert refused(data).code == code


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), 1e9])
def test_a_senseless_scale_is_refused(scale):
    assert refused(table(oval()), scale=scale).code == "track_scale"


@pytest.mark.parametrize("least", [-1.0, 0.1, 9.0, float("nan")])
def test_a_senseless_width_is_refused(least):
    assert refused(table(oval()), least_width_m=least).code == "track_least_width"


@pytest.mark.parametrize(
    "data",
    [b"1," * (MAX_BYTES // 2), b"1;2," * (MAX_BYTES // 4), b"a,b\n" * (MAX_BYTES // 4), b"\n" * MAX_BYTES],
    ids=["commas", "both separators", "headings", "empty lines"],
)
def test_no_file_within_the_limit_takes_long(data):
    began = time.process_time()
    with pytest.raises(UserFault):
        read_track(data, "x")
    assert time.process_time() - began < 10.0


@pytest.mark.parametrize("row", ["1e308,1e308,0.5,0.5", "-1e308,1,0.5,0.5", "1,1,1e308,1e308"])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_numbers_beyond_all_bounds_are_refused_without_a_warning(row, scale):
    lines = [f"{3 * math.cos(at / 10)},{2 * math.sin(at / 10)},0.5,0.5" for at in range(63)]
    lines[30] = row
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fault = refused("\n".join(lines).encode(), scale=scale)
    assert fault.code in ("track_far_away", "track_not_finite")
