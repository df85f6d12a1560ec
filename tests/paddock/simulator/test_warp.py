"""What cars see is drawn in whole numbers: by numpy and in C the same to the bit, and the same everywhere."""

from __future__ import annotations

import hashlib
import math
import random
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from paddock.simulator import compiled
from paddock.simulator.camera.optics import FRONT_CAMERA, STEREO_LEFT, STEREO_RIGHT, Optics
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.camera.view import Camera, Scene
from paddock.simulator.camera.warp import HALF_WEIGHT, CompiledWarp, NumpyWarp, Strip
from paddock.simulator.car import Pose
from paddock.simulator.solids import box
from tests.shared import CHECKOUT

from .tracks_for_tests import stadium

TRACK = stadium()
ONE = 1 << 32
needs_compiler = pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")

# Of a single and a left camera: frames that the engine of this id draws.
GOLDEN = "de427d01e8833984d146a280a86334af6ec65eb4eaa288aa75efcf0715c81e43"


@pytest.fixture(scope="module")
def scene():
    return Scene.of(TRACK)


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    """The compiled way, of the source as it is now."""
    library = tmp_path_factory.mktemp("compiled") / compiled.LIBRARY.name
    compiled.build(library)

    class Fresh(CompiledWarp):
        pass

    Fresh.library = compiled.load(library)
    return Fresh


def poses(scene, count, seed=1):
    """On the road, anywhere in the hall, at its walls and outside of it."""
    rng = random.Random(seed)
    xmin, ymin, xmax, ymax = scene.walls
    for number in range(count):
        if number % 2:
            x, y, heading = TRACK.point_at(rng.uniform(0.0, TRACK.length), rng.gauss(0.0, 0.3))
            yield Pose(x, y, heading + rng.gauss(0.0, 0.5))
        else:
            away = 30.0 if number % 10 == 0 else 0.4
            x, y = rng.uniform(xmin - away, xmax + away), rng.uniform(ymin - away, ymax + away)
            yield Pose(x, y, rng.uniform(-9.0, 9.0))


def drawn(way, strips, columns, lines, wall=14):
    warp = way(strips, columns, wall)
    warp.lines[:] = lines
    warp.draw()
    return warp.frame


def one_row(pixels, column, row, column_step=0.0, row_step=0.0, columns=1):
    """A frame of one row that looks at these places (pixels)."""
    lines = [[round(column * ONE) + HALF_WEIGHT], [round(row * ONE) + HALF_WEIGHT]]
    lines += [[round(column_step * ONE)], [round(row_step * ONE)]]
    return drawn(NumpyWarp, [Strip(np.array(pixels, np.uint8), 0, 1, 0)], columns, lines)[0].tolist()


def test_a_pixel_interpolates_its_neighbours():
    picture = [[0, 100], [200, 40]]
    assert one_row(picture, 0, 0) == [0]
    assert one_row(picture, 1, 0) == [100]
    assert one_row(picture, 0, 1) == [200]
    assert one_row(picture, 0.5, 0) == [50]
    assert one_row(picture, 0.25, 0) == [25]
    assert one_row(picture, 0.5, 0.5) == [85]
    assert one_row(picture, 0, 0, column_step=0.25, columns=5) == [0, 25, 50, 75, 100]


def test_outside_the_picture_is_wall_blended_at_the_edge():
    picture = [[114, 114], [114, 114]]
    assert one_row(picture, -2, 0, column_step=0.5, columns=9) == [14, 14, 14, 64, 114, 114, 114, 64, 14]
    assert one_row(picture, 0, -1.25, row_step=0.5, columns=8) == [14, 39, 89, 114, 114, 89, 39, 14]
    assert one_row(picture, 1e8, -1e8, column_step=-1e6, columns=3) == [14, 14, 14]


def test_a_row_of_several_lines_is_their_mean():
    picture = np.array([[10], [20], [40], [81]], np.uint8)
    lines = np.array([[0] * 4, [number * ONE for number in range(4)], [0] * 4, [0] * 4])
    assert drawn(NumpyWarp, [Strip(picture, 0, 1, 2)], 1, lines).tolist() == [[38]]
    assert drawn(NumpyWarp, [Strip(picture, 0, 2, 1)], 1, lines).tolist() == [[15], [61]]


@needs_compiler
@pytest.mark.parametrize("columns", [1, 31, 32, 33, 160])
def test_numpy_and_c_agree_bit_for_bit_on_any_lines(in_c, columns):
    rng = np.random.default_rng(columns)
    for width, height in ((1, 1), (1, 9), (2, 2), (7, 3), (40, 33), (300, 200)):
        pixels = rng.integers(0, 256, (height, width), np.uint8)
        strips = [Strip(pixels, 0, 30, 0), Strip(pixels[:, ::-1], 30, 38, 2), Strip(pixels, 38, 38, 1)]
        strips.append(Strip(pixels, 38, 44, 1))
        flat = np.full((height, width), 200, np.uint8)  # which the compiled way fills in where it sees nothing else
        strips += [Strip(flat, 44, 74, 0), Strip(flat, 74, 78, 1)]
        count = sum(strip.lines for strip in strips)
        starts = rng.uniform(-1.0, 1.0, (2, count)) * rng.choice([3.0, width + 2.0, 1e3, 1e8], count)
        steps = rng.uniform(-1.0, 1.0, (2, count)) * rng.choice([0.0, 1e-9, 0.3, 3.0, 1e5], count)
        lines = np.rint(np.vstack((starts, steps)) * ONE).astype(np.int64)
        # Exactly on the picture's border and one last bit beside it, where the compiled way changes its way.
        for row, place in enumerate((-ONE - 1, -ONE, -ONE + 1, -1, 0, 1)):
            lines[:, row] = place, 0, 0, ONE // 3
            lines[:, 6 + row] = (width - 1) * ONE + place, (height - 1) * ONE, 0, 0
            lines[:, 12 + row] = width * ONE + place, 0, -ONE // 7, 0
            lines[:, 18 + row] = 0, (height - 1) * ONE + place, ONE // 5, 0
            lines[:, -38 + row] = (width - 1) * ONE + place - (columns - 1) * 9, 0, 9, 0
            lines[:, -32 + row] = 0, -place, 0, (height - 1) * ONE // columns
        assert np.array_equal(drawn(NumpyWarp, strips, columns, lines), drawn(in_c, strips, columns, lines))


@needs_compiler
def test_numpy_and_c_aim_the_same_lines(scene, in_c):
    cameras = [Camera(scene, FRONT_CAMERA, way) for way in (in_c, NumpyWarp)]
    for pose in poses(scene, 200, seed=3):
        for camera in cameras:
            camera.render(pose)
        fast, slow = (camera._warp.lines for camera in cameras)
        assert np.array_equal(fast, slow), pose


@needs_compiler
@pytest.mark.parametrize("solids", [(), (box(0.6, -1.2, 0.3),)])
def test_a_frame_is_drawn_where_it_is_wanted(scene, in_c, solids):
    here, there = np.zeros((120, 160, 1), np.uint8), np.zeros((120, 160), np.uint8)
    apart = np.zeros((120, 160, 2), np.uint8)[:, :, 1]  # beside another
    for way in (in_c, NumpyWarp):
        camera = Camera(scene, FRONT_CAMERA, way)
        for pose in (*poses(scene, 6, seed=5), Pose(0.0, -1.2, 0.0)):
            fresh = camera.render(pose, solids)
            kept = fresh.copy()
            for place in (here, there, here, apart):
                place[...] = 1
                assert camera.render(pose, solids, place) is place
                assert place.reshape(fresh.shape).tobytes() == kept.tobytes()
            assert np.array_equal(fresh, kept)
        assert np.array_equal(camera.render(pose, solids), kept)


@needs_compiler
def test_a_place_of_another_size_is_refused(scene, in_c):
    for way in (in_c, NumpyWarp):
        with pytest.raises(ValueError):
            Camera(scene, FRONT_CAMERA, way).render(Pose(0.0, -1.2, 0.0), (), np.zeros((120, 161), np.uint8))


@needs_compiler
def test_halves_are_rounded_to_the_even_number_by_both(in_c):
    rows = [Strip(np.zeros((2, 2), np.uint8), 0, 5, 0)]
    terms = np.zeros((4, 4, 5))
    terms[3, :2] = 0.5, 1.5, -0.5, -2.5, 2.0**60 + 256
    for way in (in_c, NumpyWarp):
        warp = way(rows, 1, 14, terms)
        warp.aim(1.0, 0.0, 3.0, 4.0)
        assert warp.lines[:2].tolist() == [[0, 2, 0, -2, 2**60 + 256]] * 2


@needs_compiler
@pytest.mark.parametrize(
    "optics",
    [
        FRONT_CAMERA,
        STEREO_LEFT,
        STEREO_RIGHT,
        Optics(columns=64, rows=48, pitch=0.0),  # the horizon in its middle
        Optics(columns=100, rows=75, pitch=1.2, height=0.4),
        Optics(columns=33, rows=40, horizontal_fov=2.0, height=1.5),  # above the walls
        Optics(pitch=math.atan(0.5 / Optics().focal), rows=120),  # a row exactly at the horizon
    ],
)
def test_numpy_and_c_draw_the_same_frames(scene, in_c, optics):
    fast, slow = Camera(scene, optics, in_c), Camera(scene, optics, NumpyWarp)
    for pose in poses(scene, 30):
        assert np.array_equal(fast.render(pose), slow.render(pose)), pose


def test_frames_match_this_engines_hash(scene):
    digest = hashlib.sha256()
    for optics in (FRONT_CAMERA, STEREO_LEFT):
        camera = Camera(scene, optics, NumpyWarp)
        for pose in poses(scene, 12, seed=7):
            digest.update(camera.render(pose).tobytes())
    assert digest.hexdigest() == GOLDEN


def test_the_camera_uses_numpy_where_nothing_is_compiled(scene, monkeypatch):
    monkeypatch.setattr(CompiledWarp, "library", None)
    frame = Camera(scene).render(Pose(0.0, -1.2, 0.0))
    assert OFFICIAL.road in frame
    assert np.array_equal(frame, Camera(scene, warp=NumpyWarp).render(Pose(0.0, -1.2, 0.0)))


@needs_compiler
@pytest.mark.parametrize("changed", ["warp.c", "exchange.c"])
def test_a_library_of_another_source_is_replaced(tmp_path, monkeypatch, changed):
    library = tmp_path / "native.so"
    sources = [Path(shutil.copy(source, tmp_path)) for source in compiled.SOURCES]
    monkeypatch.setattr(compiled, "SOURCES", sources)
    compiled.build(library)
    assert compiled.load(library) is not None
    with (tmp_path / changed).open("a") as source:
        source.write("\n/* changed */\n")
    assert compiled.load(library) is None
    compiled.build(library)
    # This process has the old file open, and the loader knows it by its name: another one looks.
    script = (
        "import sys; from pathlib import Path; from paddock.simulator import compiled;"
        "*compiled.SOURCES, library = map(Path, sys.argv[1:]); print(compiled.load(library) is not None)"
    )
    command = [sys.executable, "-c", script, *map(str, sources), str(library)]
    look = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=60)
    assert look.stdout == "True\n", look.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [library.name, *(source.name for source in sources)]
    )


@pytest.mark.parametrize("content", [None, b"", b"\x7fELF and no more"])
def test_a_file_that_is_no_library_is_not_loaded(tmp_path, content):
    library = tmp_path / "warp.so"
    if content is not None:
        library.write_bytes(content)
    assert compiled.load(library) is None


def test_a_library_without_an_identity_is_not_loaded():
    assert compiled.load(Path(np._core._multiarray_umath.__file__)) is None


def test_a_missing_compiler_is_reported_and_leaves_nothing(tmp_path, monkeypatch):
    library = tmp_path / "warp.so"
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OSError, match="no C compiler"):
        compiled.build(library)
    monkeypatch.setenv("CC", "/nonexistent/cc")
    with pytest.raises(OSError):
        compiled.build(library)
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_a_failing_compiler_is_quoted_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "_FLAGS", ["-shared", "-D__BYTE_ORDER__=0"])
    with pytest.raises(RuntimeError, match="little-endian"):
        compiled.build(tmp_path / "warp.so")
    assert list(tmp_path.iterdir()) == []


def test_compiling_is_skipped_when_up_to_date(monkeypatch, capsys):
    monkeypatch.setattr(compiled, "load", lambda: object())
    monkeypatch.setattr(compiled, "build", lambda: pytest.fail("it was built"))
    assert compiled.main() == 0
    monkeypatch.setattr(compiled, "load", lambda: None)
    monkeypatch.setattr(compiled, "build", refuse)
    assert compiled.main() == 1
    assert "no C compiler" in capsys.readouterr().err


def refuse():
    raise OSError("no C compiler")
