"""The numbered turns of a track."""

import pytest

from paddock.analysis.turns import turns_of
from paddock.geometry.catalogue import by_slug
from paddock.geometry.character import character_of

SLUGS = ["reinvent-2018", "bowtie-track", "oval-track", "kumo-torakku-training", "straight-track"]


@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("slug", SLUGS)
def test_a_track_has_as_many_turns_as_corners_in_both_directions(slug, direction):
    track = by_slug(slug).geometry()
    turns = turns_of(track, direction)
    assert [turn.number for turn in turns] == list(range(1, character_of(track).corners + 1))
    assert [turn.apex_m for turn in turns] == sorted(turn.apex_m for turn in turns)
    assert all(turn.contains(turn.apex_m) for turn in turns)


def test_the_other_direction_passes_the_same_turns_in_reverse():
    track = by_slug("reinvent-2018").geometry()
    there, back = turns_of(track, "ccw"), turns_of(track, "cw")
    for turn, same in zip(there, reversed(back), strict=True):
        assert same.apex_m == pytest.approx(track.length - turn.apex_m, abs=0.4)
        assert same.degrees == pytest.approx(-turn.degrees, abs=5)


def test_a_turn_may_go_on_across_the_line():
    turn = turns_of(by_slug("bowtie-track").geometry(), "cw")[0]
    assert turn.from_m > turn.to_m
    assert turn.contains(turn.from_m + 0.1) and turn.contains(turn.to_m - 0.1)
    assert not turn.contains(turn.to_m + 0.1)


@pytest.mark.parametrize("slug", SLUGS)
def test_a_turns_number_stands_beside_the_road(slug):
    track = by_slug(slug).geometry()
    assert not [turn for turn in turns_of(track, track.direction) if track.on_road(turn.x, turn.y)]


def test_the_hairpin_of_reinvent_2018_is_its_first_turn():
    first = turns_of(by_slug("reinvent-2018").geometry(), "ccw")[0]
    assert (first.number, round(first.degrees)) == (1, 177)
