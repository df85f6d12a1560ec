"""Tracks from the community's files, and what is refused."""

import inspect
import io
import pickle
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from paddock.errors import UserFault
from paddock.errors.reasons import REASONS
from paddock.geometry import checks, files
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.files import MAX_BYTES, MAX_ROWS, read_npy, write_npy
from paddock.geometry.track import TrackGeometry
from tests.shared import SHARED, needs_shared
from tests.soak import some

# Metres, from the field's own table of these files, which gives two decimals (H_track is not in it: measured).
LENGTHS = {
    "2022_april_open": 50.3,
    "2022_april_pro": 67.46,
    "2022_august_open": 43.31,
    "2022_august_pro": 63.88,
    "2022_july_open": 40.2,
    "2022_july_pro": 57.89,
    "2022_june_open": 41.28,
    "2022_june_pro": 58.61,
    "2022_march_open": 48.07,
    "2022_march_pro": 76.76,
    "2022_may_open": 46.13,
    "2022_may_pro": 63.86,
    "2022_october_open": 49.57,
    "2022_october_pro": 62.08,
    "2022_reinvent_champ": 33.28,
    "2022_september_open": 45.3,
    "2022_september_pro": 60.18,
    "2022_summit_speedway": 25.17,
    "2022_summit_speedway_mini": 22.45,
    "AWS_track": 69.25,
    "Albert": 51.39,
    "AmericasGeneratedInclStart": 39.07,
    "Aragon": 59.92,
    "Austin": 59.35,
    "Belille": 60.06,
    "Bowtie_track": 17.43,
    "Canada_Training": 21.74,
    "China_track": 22.92,
    "FS_June2020": 52.87,
    "H_track": 100.85,
    "July_2020": 59.91,
    "LGSWide": 38.03,
    "Mexico_track": 20.51,
    "Monaco": 60.27,
    "Monaco_building": 60.27,
    "New_York_Track": 21.88,
    "Oval_track": 19.55,
    "Singapore": 60.47,
    "Singapore_building": 60.47,
    "Singapore_f1": 60.47,
    "Spain_track": 60,
    "Spain_track_f1": 60,
    "Tokyo_Training_track": 22.63,
    "Vegas_track": 22.55,
    "Virtual_May19_Train_track": 19.45,
    "arctic_open": 42.22,
    "arctic_pro": 59.52,
    "caecer_gp": 73.16,
    "caecer_loop": 35.09,
    "dubai_open": 40.66,
    "dubai_pro": 64.95,
    "hamption_open": 45.93,
    "hamption_pro": 60.74,
    "jyllandsringen_open": 46.12,
    "jyllandsringen_pro": 62.03,
    "morgan_open": 45.04,
    "morgan_pro": 59.27,
    "penbay_open": 68.68,
    "penbay_pro": 89.24,
    "reInvent2019_track": 23.12,
    "reInvent2019_wide": 16.64,
    "reInvent2019_wide_ccw": 16.6,
    "reInvent2019_wide_cw": 16.6,
    "red_star_open": 43.49,
    "red_star_pro": 68.9,
    "reinvent_base": 17.71,
    "thunder_hill_open": 40.91,
    "thunder_hill_pro": 59.15,
}
CLOCKWISE = {
    "Albert",
    "Aragon",
    "Belille",
    "FS_June2020",
    "July_2020",
    "Monaco",
    "Monaco_building",
    "Spain_track",
    "Spain_track_f1",
    "reInvent2019_wide_cw",
}
# Median width in metres, from the same table.
WIDTHS = {"AWS_track": 0.61, "Austin": 1.412, "Spain_track": 0.909, "caecer_loop": 1.28, "reInvent2019_wide": 1.067}

FILES = sorted((SHARED / "tracks").glob("*.npy"))


def saved(rows, **options):
    stream = io.BytesIO()
    np.save(stream, rows, **options)
    return stream.getvalue()


def rows_of(track):
    return np.load(io.BytesIO(write_npy(track)))


def circle(radius=3.0, width=1.0, points=60):
    angle = np.linspace(0, 2 * np.pi, points + 1)
    unit = np.column_stack((np.cos(angle), np.sin(angle)))
    return np.hstack((radius * unit, (radius - width / 2) * unit, (radius + width / 2) * unit))


def refused(data):
    with pytest.raises(UserFault) as caught:
        read_npy(data if isinstance(data, bytes) else saved(data), "refused")
    assert "?" not in str(caught.value), "a placeholder of the sentence has no value"
    return caught.value


@needs_shared
def test_every_community_file_is_listed_here():
    assert {path.stem for path in FILES} == {*LENGTHS, "Straight_track"}


@needs_shared
@pytest.mark.parametrize("path", some([path for path in FILES if path.stem in LENGTHS], 4), ids=lambda path: path.stem)
def test_a_community_file_imports_with_its_length_and_direction(path):
    track = read_npy(path.read_bytes(), path.stem)
    assert track.length == pytest.approx(LENGTHS[path.stem], abs=0.0051)
    raw = np.load(path)
    assert track.length == pytest.approx(np.linalg.norm(np.diff(raw[:, :2], axis=0), axis=1).sum(), abs=1e-9)
    assert track.direction == ("cw" if path.stem in CLOCKWISE else "ccw")
    assert np.array_equal(np.hstack((track.centre, track.inner, track.outer))[0], raw[0])
    widths = [track.width_at(distance) for distance in np.linspace(0, track.length, 300)]
    assert np.median(widths) == pytest.approx(WIDTHS.get(path.stem, np.median(widths)), abs=0.005)
    assert max(widths) < 1.3 * np.median(widths), "no line across the road misses its border"
    assert read_npy(write_npy(track), path.stem) == track


@needs_shared
@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("path", some([path for path in FILES if path.stem in LENGTHS], 8), ids=lambda path: path.stem)
def test_a_lap_of_a_community_track_makes_steady_progress(path, direction):
    track = read_npy(path.read_bytes(), path.stem).in_direction(direction)
    hint, before, total = 0, 0.0, 0.0
    for distance in np.linspace(0, track.length, int(track.length / 0.1) + 1)[1:]:
        left, right = track.half_widths_at(distance)
        x, y, _ = track.point_at(distance, 0.5 * (left if int(distance) % 2 else -right))
        assert track.on_road(x, y)
        found = track.project(x, y, hint)
        moved = np.remainder(found.distance - before + track.length / 2, track.length) - track.length / 2
        assert 0.0 < moved < 0.2
        total += moved
        hint, before = found.index, found.distance
    assert total == pytest.approx(track.length, abs=1e-6)


def test_an_open_track_is_refused_where_a_loop_is_meant():
    fault = refused(by_slug("straight-track").npy)
    assert fault.code == "track_open"
    assert fault.params["gap_m"] == pytest.approx(5.71, abs=0.005)


@pytest.mark.parametrize("entry", CATALOGUE[:7], ids=lambda entry: entry.slug)
def test_a_written_track_reads_back_the_same(entry):
    track = entry.geometry("cw")
    rows = rows_of(track)
    assert rows.dtype == np.float64 and rows.shape == (len(track) + 1, 6)
    assert np.array_equal(rows[0], rows[-1])
    assert read_npy(write_npy(track), entry.name) == track


def test_other_number_types_and_orders_are_read():
    truth = read_npy(saved(circle()), "circle")
    assert read_npy(saved(np.asfortranarray(circle())), "circle") == truth
    assert read_npy(saved(circle().astype(">f8")), "circle") == truth
    assert read_npy(saved(circle().astype(np.float32)), "circle").length == pytest.approx(truth.length, rel=1e-6)
    assert read_npy(saved(circle(35.0, 3.0).round().astype(np.int32)), "circle").length > 200
    assert read_npy(saved(circle()[:-1]), "circle").length == pytest.approx(truth.length)  # first row not repeated


class Trap:
    opened = False

    def __reduce__(self):
        return setattr, (Trap, "opened", True)


def test_pickled_objects_are_never_opened():
    assert refused(saved(np.array([Trap(), Trap()], dtype=object), allow_pickle=True)).code == "track_pickled"
    assert refused(pickle.dumps(Trap())).code == "track_pickled"
    assert not Trap.opened


def header(text):
    text = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"x,y\n1,2\n",
        b"PK\x03\x04 an npz file",
        b"\x93NUMPY",
        b"\x93NUMPY\x03\x00" + bytes(100),
        b"\x93NUMPY\x01\x00\xff\xff",
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (100, 6)}"),
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 6)}"),
        header("{'descr': '<q9', 'fortran_order': False, 'shape': (100, 6)}"),
        header("__import__('os').getcwd()"),
        header("(" * 50),
        saved(circle())[:-3],
        saved(circle()) + b"more",
    ],
)
def test_a_truncated_or_non_npy_file_is_refused(data):
    assert refused(data).code == "track_not_npy"


def test_a_header_promising_a_huge_array_takes_no_memory():
    data = header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 6)}")
    assert refused(data).code == "track_too_large"


@pytest.mark.parametrize("shape", ["(0x" + "f" * 9000 + ", 6)", "(6, 0x" + "f" * 9000 + ")", "(True, 6)"])
def test_an_invalid_size_is_refused(shape):
    """Python writes no number of more than 4300 digits, so such a one must not get into a sentence."""
    assert refused(header(f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}") + bytes(48)).code == (
        "track_not_npy"
    )


@pytest.mark.parametrize(
    ("descr", "shape"), [(f"[('\x1b<b>{'x' * 8000}', '<f8')]", "(3, 6)"), ("'<f8'", f"({'1, ' * 3000})")]
)
def test_an_uploaded_header_is_quoted_only_in_short(descr, shape):
    fault = refused(header(f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}"))
    assert fault.code == "track_shape"
    assert len(str(fault)) < 300
    assert str(fault).isprintable()


def test_files_with_too_many_bytes_or_points_are_refused():
    assert refused(bytes(MAX_BYTES + 1)).code == "track_file_too_large"
    assert refused(np.zeros((MAX_ROWS + 1, 6))).code == "track_too_large"
    assert refused(circle(30.0, points=2500)).code == "track_too_large"


@pytest.mark.parametrize(
    "rows",
    [np.zeros((50, 4)), np.zeros(300), np.zeros((50, 2, 3)), np.zeros((50, 6), complex), np.zeros((50, 6), "U3")],
)
def test_a_table_of_another_shape_or_type_is_refused(rows):
    assert refused(rows).code == "track_shape"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_non_finite_point_is_refused_with_its_row(value):
    rows = circle()
    rows[7, 3] = value
    fault = refused(rows)
    assert (fault.code, fault.params) == ("track_not_finite", {"row": 7})


def bent(change):
    rows = circle(points=60)
    change(rows)
    return rows


def zigzag(rows):
    rows[10, :2] = rows[14, :2]


def eight(rows):
    angle = np.linspace(0, 2 * np.pi, len(rows))
    rows[:, 0], rows[:, 1] = 6 * np.sin(angle), 3 * np.sin(2 * angle)
    rows[:, 2:4], rows[:, 4:6] = rows[:, :2] * 0.9, rows[:, :2] * 1.1


def inner_over_outer(rows):
    rows[10:13, 2:4] *= 1.6


def inner_loop(rows):
    rows[[10, 11], 2:4] = rows[[11, 10], 2:4]


def centre_over_border(rows):
    rows[10:20, :2] *= 1.25


def both_outside(rows):
    rows[:, 2:4] = rows[:, :2] * 1.1
    rows[:, 4:6] = rows[:, :2] * 1.3


@pytest.mark.parametrize(
    ("rows", "code"),
    [
        (circle(points=60)[[0, 0, 20, 20, 40, 0]], "track_too_few_points"),
        (np.zeros((0, 6)), "track_too_few_points"),
        (np.zeros((100, 6)), "track_too_few_points"),
        (circle() + 5000.0, "track_far_away"),
        (circle() * 1e200, "track_far_away"),
        (circle(0.7, 0.6), "track_too_short"),
        (circle(200.0), "track_too_long"),
        (circle(points=60)[:50], "track_open"),
        (circle(width=0.2), "track_too_narrow"),
        (circle(radius=9.0, width=5.0), "track_too_wide"),
        (bent(zigzag), "track_turns_back"),
        (bent(eight), "track_self_crossing"),
        (bent(inner_over_outer), "track_borders_cross"),
        (bent(inner_loop), "track_borders_cross"),
        (bent(centre_over_border), "track_borders_cross"),
        (bent(both_outside), "track_borders_apart"),
    ],
)
def test_an_impossible_road_is_refused_with_its_reason(rows, code):
    assert refused(rows).code == code


def test_malformed_lines_are_refused():
    good = circle()
    for lines in (
        ("nonsense", good[:, 2:4], good[:, 4:6]),
        (good[:, :2], good[:-1, 2:4], good[:, 4:6]),
        ([[1.0, 2.0], [3.0]], good[:, 2:4], good[:, 4:6]),
        (None, None, None),
    ):
        with pytest.raises(UserFault) as caught:
            TrackGeometry.from_arrays("refused", *lines)
        assert caught.value.code == "track_shape"


def test_crossing_borders_name_the_lines_and_waypoints():
    fault = refused(bent(inner_over_outer))
    assert fault.params["line"] == "inner border" and fault.params["other_line"] == "outer border"
    assert 9 <= fault.params["row"] <= 13


def test_every_refusal_of_a_file_has_a_test():
    """The codes raised while a file is read and the cases of this file stay together."""
    raised = {
        code
        for module in (checks, files)
        for code in re.findall(r'UserFault\("(track_\w+)"', inspect.getsource(module))
    }
    tested = inspect.getsource(sys.modules[__name__]) + Path(__file__).with_name("test_csv.py").read_text()
    assert len(raised) >= 15 and raised <= set(REASONS)
    assert [code for code in sorted(raised) if f'"{code}"' not in tested] == []
