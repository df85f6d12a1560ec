"""Corners and difficulty of a track, by their definition."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE, by_slug
from paddock.geometry.character import character_of
from paddock.geometry.track import TrackGeometry


def stadium(straight: float, radius: float, width: float = 1.07) -> TrackGeometry:
    """Two straights of so many metres joined by two half circles."""
    turn = np.linspace(-math.pi / 2, math.pi / 2, 60)
    x = np.concatenate([np.linspace(-straight / 2, straight / 2, 80)[:-1], straight / 2 + radius * np.cos(turn)])
    y = np.concatenate([np.full(79, -radius), radius * np.sin(turn)])
    half = np.column_stack((x, y))[:-1]
    centre = np.vstack((half, -half))
    ahead = np.roll(centre, -1, axis=0) - np.roll(centre, 1, axis=0)
    across = np.column_stack((-ahead[:, 1], ahead[:, 0])) / np.linalg.norm(ahead, axis=1)[:, None] * (width / 2)
    return TrackGeometry.from_arrays("stadium", centre, centre + across, centre - across)


def test_a_stadium_has_two_corners():
    assert character_of(stadium(10.0, 1.5)).corners == 2


def test_its_difficulty_follows_from_the_definition():
    track = stadium(10.0, 1.5)
    bends = math.tau * 1.5
    slow = math.sqrt(4.0 * 1.5)
    lap = 20.0 / 4.0 + bends / slow
    assert character_of(track).difficulty == pytest.approx(100.0 * (1.0 - (20.0 + bends) / 4.0 / lap), abs=1.5)


def test_a_narrow_road_is_harder_than_a_wide_one():
    assert character_of(stadium(10.0, 1.5, width=0.7)).difficulty > character_of(stadium(10.0, 1.5)).difficulty


def test_a_wide_bend_is_no_corner():
    assert character_of(stadium(10.0, 6.0)).corners == 0


@pytest.mark.parametrize("slug", ["oval", "kuei-raceway", "cosmic-circuit", "bowtie-track"])
def test_both_directions_have_the_same_character(slug):
    entry = by_slug(slug)
    assert character_of(entry.geometry("ccw")) == character_of(entry.geometry("cw"))


def test_the_catalogue_ranges_from_easy_to_hard():
    found = [character_of(entry.geometry()) for entry in CATALOGUE if not entry.is_open]
    assert min(character.difficulty for character in found) < 15
    assert max(character.difficulty for character in found) > 60
    assert all(2 <= character.corners <= 20 for character in found)
