"""The tracks that Paddock brings along."""

from __future__ import annotations

import csv
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from paddock.geometry import catalogue
from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.character import character_of, median_width
from paddock.geometry.checks import find_crossing
from tests.shared import SHARED
from tests.soak import some

every_track = pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.slug)
DATA = Path(str(files(catalogue) / "data"))
# The same roads under a second name, and two drawn anew with every other waypoint
VARIANTS = {
    "Monaco_building",
    "Singapore_building",
    "Singapore_f1",
    "Spain_track_f1",
    "reInvent2019_wide_ccw",
    "reInvent2019_wide_cw",
}


def test_the_league_tracks_come_first_under_their_names():
    assert [(entry.name, entry.file) for entry in CATALOGUE[:7]] == [
        ("Baja Turnpike", "dubai_open"),
        ("Baja Highway", "dubai_pro"),
        ("Kuei Raceway", "hamption_open"),
        ("Kuei Super Raceway", "hamption_pro"),
        ("Cosmic Loop", "jyllandsringen_open"),
        ("Cosmic Circuit", "jyllandsringen_pro"),
        ("Paddock Oval", "paddock_oval"),
    ]
    others = [entry.slug for entry in CATALOGUE[7:]]
    assert len(others) > 50 and others == sorted(others)


def test_names_slugs_and_files_stand_once():
    for field in ("name", "slug", "file", "fingerprint"):
        assert len({getattr(entry, field) for entry in CATALOGUE}) == len(CATALOGUE)
    with pytest.raises(KeyError):
        by_slug("monza")


def test_every_file_of_the_catalogue_is_listed():
    listed = {row["file"] for row in csv.DictReader((DATA / "catalogue.csv").read_text().splitlines())}
    assert listed == {path.stem for path in DATA.glob("*.npy")}
    assert "Apache License" in (DATA / "NOTICE").read_text()


@every_track
def test_a_track_never_changes_under_its_results(entry):
    """A change here moves lap times: it needs a new engine id and a word in the changelog."""
    assert entry.geometry().fingerprint == entry.fingerprint


@every_track
def test_the_list_says_what_the_file_says(entry):
    track = entry.geometry()
    assert entry.length_m == pytest.approx(track.length, abs=5e-4)
    assert entry.width_m == pytest.approx(median_width(track), abs=5e-4)
    assert (entry.direction, entry.corners, entry.difficulty) == (track.direction, *character_of(track))
    assert entry.is_open is track.is_open


@every_track
def test_a_track_drives_the_way_its_file_runs(entry):
    track = entry.geometry()
    assert track.name == entry.name
    assert entry.geometry(track.direction) is track
    other = "cw" if track.direction == "ccw" else "ccw"
    assert entry.geometry(other).direction == other
    assert entry.geometry(other).length == pytest.approx(track.length)


@pytest.mark.parametrize("entry", some(CATALOGUE, 4), ids=lambda entry: entry.slug)
def test_no_line_of_a_track_crosses_another_or_itself(entry):
    track = entry.geometry()
    lines = (track.centre, track.inner, track.outer)
    assert all(find_crossing(line, is_open=entry.is_open) is None for line in lines)
    if not entry.is_open:  # those of an open one close over its own rows
        assert all(find_crossing(a, b) is None for a in lines for b in lines if a is not b)


def test_the_whole_old_catalogue_is_here_to_the_centimetre():
    folder = SHARED / "tracks"
    if not folder.is_dir():
        pytest.skip("the old console's catalogue is not on this machine")
    known = {entry.file: entry for entry in CATALOGUE}
    here = {path.stem for path in folder.glob("*.npy")} - VARIANTS
    assert not here - set(known)
    for name in sorted(here & set(known)):
        rows = np.load(folder / f"{name}.npy")
        track = known[name].geometry()
        for columns, line in ((slice(0, 2), track.centre), (slice(2, 4), track.inner), (slice(4, 6), track.outer)):
            apart = np.linalg.norm(rows[:, None, columns] - line[None], axis=2)
            nearest = min(apart.min(axis=1).max(), 9.0)
            if columns.start and nearest > 0.01:  # a file whose borders stand the other way round
                swapped = track.outer if line is track.inner else track.inner
                nearest = np.linalg.norm(rows[:, None, columns] - swapped[None], axis=2).min(axis=1).max()
            assert nearest < 0.01, (name, columns)
