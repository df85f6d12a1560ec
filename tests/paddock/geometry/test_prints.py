"""Tracks at their true size: lengths and widths are measured in the files themselves."""

from __future__ import annotations

import re
import time
import zlib

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.markings import markings_of
from paddock.geometry.prints import (
    PAPERS,
    Drawing,
    bill_of_tape,
    drawing_of,
    write_dxf,
    write_pdf,
    write_svg,
    write_tiles,
)
from paddock.geometry.prints.pdf import MARGIN_MM, OVERLAP_MM, tiles_of
from paddock.simulator.camera.theme import OFFICIAL
from tests.paddock.simulator.tracks_for_tests import stadium

MM = 25.4 / 72


@pytest.fixture(scope="module")
def oval() -> Drawing:
    return drawing_of(by_slug("oval").geometry(), OFFICIAL)


def length(ring: np.ndarray) -> float:
    return float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum())


def area(ring: np.ndarray) -> float:
    x, y = ring[:, 0], ring[:, 1]
    return float(abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2)


def of_svg(data: bytes, layer: str) -> list[list[np.ndarray]]:
    """The shapes of a layer, in millimetres of the sheet."""
    text = data.decode()
    group = text[text.index(f'<g id="{layer}"') :].split("</g>")[0]
    rings = [re.findall(r"M([^Z]*)Z", path) for path in re.findall(r'<path d="([^"]*)"', group)]
    return [[np.array([point.split() for point in ring.split("L")], float) for ring in shape] for shape in rings]


def of_dxf(data: bytes, layer: str) -> list[np.ndarray]:
    lines = data.decode().splitlines()
    pairs = list(zip(map(int, lines[::2]), lines[1::2], strict=True))
    rings, points, kind = [], [], ""
    for at, (code, value) in enumerate(pairs):
        if code == 0:
            kind = value
            if kind == "SEQEND":
                rings.append(np.array(points))
                points = []
        elif code == 8 and kind == "VERTEX" and value == layer.upper():
            points.append((float(pairs[at + 1][1]), float(pairs[at + 2][1])))
    return [ring for ring in rings if len(ring)]


def streams(data: bytes) -> list[str]:
    found = re.findall(rb"/Length (\d+) >>\nstream\n", data)
    starts = [match.end() for match in re.finditer(rb"/Length \d+ >>\nstream\n", data)]
    return [
        zlib.decompress(data[at : at + int(size)]).decode("latin-1") for at, size in zip(starts, found, strict=True)
    ]


def pages(data: bytes) -> list[tuple[float, float, int]]:
    """Width and height of each page in millimetres, and its unit."""
    said = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\](?: /UserUnit (\d+))?", data)
    return [(float(w) * int(u or 1) * MM, float(h) * int(u or 1) * MM, int(u or 1)) for w, h, u in said]


def test_an_svg_is_as_large_as_the_floor(oval: Drawing) -> None:
    track = by_slug("oval").geometry()
    xmin, ymin, xmax, ymax = track.bounds
    data = write_svg(oval).decode()
    width, height = (float(one) for one in re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', data).groups())
    assert (width, height) == pytest.approx(((xmax - xmin) * 1000 + 200, (ymax - ymin) * 1000 + 200), abs=0.01)
    assert f'viewBox="0 0 {width:.2f} {height:.2f}"' in data, "a unit is a millimetre"


def test_border_lines_have_their_true_width_and_length_in_every_file(oval: Drawing) -> None:
    shapes = of_svg(write_svg(oval), "lines")
    dxf = iter(of_dxf(write_dxf(oval), "lines"))
    assert len(shapes) == 2
    for (edge, within), tape in zip(shapes, oval.markings.tapes, strict=True):
        metres = length(tape)
        assert abs(area(edge) - area(within)) / (metres * 1000) == pytest.approx(OFFICIAL.line_width * 1000, abs=0.1)
        for ring in (edge, within):
            assert length(next(dxf)) == pytest.approx(length(ring), rel=1e-5)
    outer, inner = (line.metres for line in bill_of_tape(oval.markings)[:2])
    half = OFFICIAL.line_width / 2 * 2 * np.pi  # a tape's middle runs half a width within its border, all the way round
    borders = sorted((length(line) for line in oval.markings.road), reverse=True)
    assert (outer, inner) == pytest.approx((borders[0] - half, borders[1] + half), abs=0.02)


def test_dashes_are_those_that_the_camera_sees(oval: Drawing) -> None:
    dashes = of_svg(write_svg(oval), "dashes")
    line = bill_of_tape(oval.markings)[-1]
    assert len(dashes) == line.pieces == 177
    sides = np.linalg.norm(np.diff(dashes[0][0], axis=0), axis=1)
    assert sides[:2] == pytest.approx((OFFICIAL.dash_length * 1000, OFFICIAL.dash_width * 1000), abs=0.2)
    assert line.metres == pytest.approx(177 * OFFICIAL.dash_length)


def test_a_pdf_is_one_page_of_the_floors_size(oval: Drawing) -> None:
    data = write_pdf(oval)
    ((width, height, unit),) = pages(data)
    assert (width, height) == pytest.approx((oval.width, oval.height), abs=0.01)
    assert unit == 2, "no page is longer than 14400 units"
    shape, page = streams(data)
    scale = float(page.split()[0]) * unit * MM
    assert scale == pytest.approx(1.0, abs=1e-6)
    drawn = re.search(r"1\.0000 1\.0000 1\.0000 rg\n(.*) h\n", shape).group(1).split(" h\n")[0]
    ring = np.array(re.findall(r"([\d.]+) ([\d.]+) [ml]", drawn), float)
    assert length(ring) == pytest.approx(length(oval.markings.road[0]) * 1000, rel=1e-5)


@pytest.mark.parametrize("paper", PAPERS)
def test_pages_have_their_papers_size_and_together_show_the_road(paper: str, oval: Drawing) -> None:
    data = write_tiles(oval, paper)
    tiles, (width, height) = tiles_of(oval, paper)
    sizes = pages(data)
    assert len(sizes) == len(tiles) + 1
    assert all(size[:2] == pytest.approx(PAPERS[paper], abs=0.01) for size in sizes)
    for x, y in np.vstack(oval.layers["road"][0]):
        assert any(t.x <= x <= t.x + width and t.y <= y <= t.y + height for t in tiles)
    assert (width, height) == tuple(side - 2 * MARGIN_MM for side in PAPERS[paper])


def test_neighbouring_pages_share_a_strip(oval: Drawing) -> None:
    tiles, (width, height) = tiles_of(oval, "a3")
    by_name = {tile.name: tile for tile in tiles}
    left, right, below = by_name["1-10"], by_name["1-11"], by_name["2-10"]
    assert left.x + width - right.x == pytest.approx(OVERLAP_MM)
    assert below.y + height - left.y == pytest.approx(OVERLAP_MM)


def test_a_page_shows_its_part_at_true_size(oval: Drawing) -> None:
    tiles, _ = tiles_of(oval, "a4")
    page = streams(write_tiles(oval, "a4"))[2]  # after the shapes and the overview
    assert page.split()[1:8:6] == [page.split()[1], "cm"]
    assert float(page.split()[1]) == pytest.approx(1 / MM)
    x, y = re.search(r"1 0 0 1 (\S+) (\S+) cm /D Do", page).groups()
    assert (float(x), float(y)) == pytest.approx((MARGIN_MM - tiles[0].x, MARGIN_MM - tiles[0].y), abs=0.001)
    assert page.count(" l S") == 8, "four crosses"


def test_an_open_road_has_lines_across_its_ends_and_one_border() -> None:
    track = by_slug("straight-track").geometry()
    bill = {line.kind: line for line in bill_of_tape(markings_of(track, OFFICIAL))}
    assert set(bill) == {"border", "across", "dashes"}
    assert bill["across"].pieces == 2
    assert bill["across"].metres == pytest.approx(
        sum(sum(track.half_widths_at(at)) for at in (0.0, track.finish_m)), abs=0.01
    )
    assert not drawing_of(track, OFFICIAL).layers["start"]


def test_a_lap_begins_beside_the_road() -> None:
    drawing = drawing_of(stadium(), OFFICIAL)
    assert len(drawing.layers["start"]) == 2


def test_words_of_a_name_cannot_end_a_word_of_the_page() -> None:
    track = drawing_of(by_slug("oval").geometry(), OFFICIAL)
    named = Drawing("a) Tj (트랙 \\", track.width, track.height, track.layers, track.markings)
    page = streams(write_tiles(named, "a0"))[2]
    assert r"(a\) Tj \(?? \\   1-1   1:1   A0) Tj" in page
    assert b"&lt;" in write_svg(Drawing("<a>", track.width, track.height, track.layers, track.markings))


def test_the_pages_of_a_long_track_are_found_quickly():
    """All papers of the longest track together, in processor time."""
    longest = max(CATALOGUE, key=lambda track: track.length_m).geometry()
    drawing = drawing_of(longest, OFFICIAL)
    began = time.thread_time()
    pages = {paper: len(tiles_of(drawing, paper)[0]) for paper in PAPERS}
    assert time.thread_time() - began < 0.15  # 0.39 when each page was compared with each edge
    assert 0 < pages["a0"] < pages["a1"] < pages["a2"] < pages["a3"] < pages["a4"]
