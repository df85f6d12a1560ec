"""The tracks that Paddock brings along."""

import math

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE, ROAD_WIDTH_M, by_slug
from paddock.geometry.catalogue.curve import road
from paddock.geometry.checks import find_crossing

every_track = pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.slug)

# A change here moves lap times: it needs a new engine id and a word in the changelog.
FINGERPRINTS = {
    "baja-turnpike": "1028b81873eb02ecbe1376d14da737c52f35b076bf11270808745f6b3a9ec918",
    "baja-highway": "0a19cf4cd184d730310b24786cae74a2485669418383c8e474fa2f25518066f7",
    "kuei-raceway": "a7d549fa994a2533814366a795c080a2e6876f241b898b0b3f31946d30be553b",
    "kuei-super-raceway": "62ddf0c32f8d2917e6424e71094255df14b85279ad1b9bd8ab4b272d29920c76",
    "cosmic-loop": "fa9b0817f6335875547148b6041e2c2376e76158efd062bcffdd4804881dd03e",
    "cosmic-circuit": "731f283c7433f40284ec7a5cedb537825e6bda8d3f6a634f78378540c3b2a701",
    "oval": "6556327117c63bc3ee73d7efd6a90a66c63adb589d31f38b99daa80de37a1254",
}


def curvature(track):
    step = np.roll(track.centre, -1, axis=0) - track.centre
    heading = np.arctan2(step[:, 1], step[:, 0])
    turn = np.angle(np.exp(1j * (np.roll(heading, -1) - heading)))
    return turn / np.linalg.norm(step, axis=1)


def straights(track):
    """Lengths of the stretches without a bend, longest first; the finish lies within one, not at its end."""
    bent = np.abs(curvature(track)) > 0.02
    rolled = np.roll(bent, -int(np.argmax(bent)))
    runs = "".join("x" if value else "-" for value in rolled).split("x")
    return sorted((len(run) * track.length / len(track) for run in runs if run), reverse=True)


def turns(track, smallest=60.0):
    """Degrees of each bend (same sign without a pause) of at least ``smallest`` degrees, in driving order."""
    bend = curvature(track) * track.length / len(track)
    bend[np.abs(curvature(track)) < 0.02] = 0.0
    result, total = [], 0.0
    for value in bend:
        if value * total < 0 or value == 0.0:
            result.append(total)
            total = 0.0
        total += value
    result.append(total)
    return [round(math.degrees(value)) for value in result if abs(math.degrees(value)) >= smallest]


def test_the_catalogue_holds_the_tracks_learners_know():
    lengths = {entry.slug: entry.stated_length_m for entry in CATALOGUE}
    assert lengths == {
        "baja-turnpike": 40.79,
        "baja-highway": 65.18,
        "kuei-raceway": 46.15,
        "kuei-super-raceway": 60.96,
        "cosmic-loop": 46.18,
        "cosmic-circuit": 62.24,
        "oval": 18.0,
    }
    assert by_slug("oval").name == "Paddock Oval"
    with pytest.raises(KeyError):
        by_slug("monza")


@every_track
def test_a_track_has_its_stated_length_width_and_even_spacing(entry):
    track = entry.geometry()
    assert track.length == pytest.approx(entry.stated_length_m, rel=0.005)
    assert track.direction == "ccw"
    assert track.name == entry.name
    steps = np.diff([*track.cumulative, track.length])
    assert steps.min() > 0.1 and steps.max() < 0.2 and steps.max() / steps.min() < 1.05
    widths = [track.width_at(distance) for distance in np.linspace(0, track.length, 500)]
    assert min(widths) > ROAD_WIDTH_M - 0.02 and max(widths) < ROAD_WIDTH_M + 0.02
    assert entry.description.endswith(".")


@every_track
@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_no_line_of_a_track_crosses_itself_or_another(entry, direction):
    track = entry.geometry(direction)
    lines = (track.centre, track.inner, track.outer)
    assert all(find_crossing(line) is None for line in lines)
    assert all(find_crossing(a, b) is None for a in lines for b in lines if a is not b)


@every_track
def test_corners_are_wide_and_neighbouring_parts_stay_apart(entry):
    track = entry.geometry()
    assert np.abs(curvature(track)).max() < 1 / 0.74
    along = np.abs(track.cumulative[:, None] - track.cumulative[None])
    along = np.minimum(along, track.length - along)
    between = np.linalg.norm(track.centre[:, None] - track.centre[None], axis=2)
    assert between[along > 2.2].min() > ROAD_WIDTH_M + 0.3


@every_track
def test_the_finish_line_lies_on_a_straight(entry):
    track = entry.geometry()
    headings = [track.point_at(distance)[2] for distance in np.linspace(-0.6, 1.0, 20)]
    assert max(headings) - min(headings) < 1e-3


@every_track
def test_a_catalogue_tracks_geometry_never_changes(entry):
    assert entry.geometry().fingerprint == FINGERPRINTS[entry.slug]


def test_each_track_has_its_own_character():
    known = {entry.slug: entry.geometry() for entry in CATALOGUE}
    for slug, track in known.items():
        assert sum(turns(track, smallest=0)) == pytest.approx(360, abs=12), slug

    turnpike = known["baja-turnpike"]
    assert straights(turnpike)[0] > 12  # full throttle ...
    assert turns(turnpike)[0] > 170  # ... into a harsh hairpin
    assert sum(75 <= abs(turn) <= 105 for turn in turns(turnpike)) >= 8

    highway = known["baja-highway"]
    assert straights(highway)[1] > 10  # the second massive straight
    assert sum(abs(turn) > 170 for turn in turns(highway)) >= 2
    assert {turn > 0 for turn in turns(highway)[-7:]} == {True, False}  # cutbacks swing both ways

    raceway = turns(known["kuei-raceway"])
    assert raceway[0] > 165 and raceway[1] < -165  # two straights between two hairpins
    assert sum(abs(turn) > 165 for turn in raceway) == 3  # and the cutback hairpin

    super_raceway = known["kuei-super-raceway"]
    assert straights(super_raceway)[1] > 8
    small = [turn for turn in turns(super_raceway, smallest=38) if abs(turn) < 60]
    assert len(small) >= 8  # four double apexes

    loop = known["cosmic-loop"]
    assert straights(loop)[0] > 10 and straights(loop)[1] < 4  # one sprint straight
    assert sum(abs(turn) > 165 for turn in turns(loop)) == 2
    assert sum(60 <= abs(turn) <= 115 for turn in turns(loop)) >= 6

    circuit = known["cosmic-circuit"]
    assert straights(circuit)[0] < 3.5  # no true straight
    assert sum(70 <= abs(turn) <= 120 for turn in turns(circuit)) >= 8


def test_control_points_with_unfitting_arcs_are_refused():
    square = [(4.0, 0.0, 1.0), (4.0, 4.0, 1.0), (0.0, 4.0, 1.0), (0.0, 0.0, 1.0)]
    options = {"length_m": 14.0, "width_m": 1.0, "spacing_m": 0.15}
    centre, left, right = road(square, finish_m=1.0, **options)
    assert centre.shape == left.shape == right.shape == (93, 2)
    with pytest.raises(ValueError, match="overlap"):
        road([(x, y, 2.5) for x, y, _ in square], finish_m=1.0, **options)
    with pytest.raises(ValueError, match="finish"):
        road(square, finish_m=2.5, **options)
