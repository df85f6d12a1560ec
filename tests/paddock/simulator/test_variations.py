"""The variations of a lap that a car's report drives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import HEAD_TO_HEAD, RaceRules
from paddock.rules.report import ALL, EACH, KINDS, SENSORS, START, VARIATIONS
from paddock.simulator.action import ActionSpace
from paddock.simulator.camera.theme import OFFICIAL
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.randomisation import check_placed, variations

from .tracks_for_tests import stadium


def drawn(variation):
    found = variation.disturbance(OFFICIAL)
    arrays = [None if array is None else array.tobytes() for array in (found.greys, found.noise)]
    return (found.aside, found.turn, found.lidar_noise, found.latency, *arrays)


def test_a_hundred_of_five_kinds_that_grow():
    found = variations(7, 18.0)
    assert [one.number for one in found] == list(range(VARIATIONS)) and VARIATIONS == 100
    for kind in KINDS:
        assert [one.percent for one in found if one.kind == kind] == list(range(5, 101, 5))
    assert len(KINDS) * EACH == VARIATIONS


def test_the_seed_and_the_number_alone_decide():
    one, same, other = variations(7, 18.0), variations(7, 18.0), variations(8, 18.0)
    assert one == same and [drawn(a) for a in one] == [drawn(a) for a in same[::-1]][::-1]
    assert all(drawn(a) != drawn(b) for a, b in zip(one, other, strict=True))
    assert len({drawn(a) for a in one}) == VARIATIONS


def test_each_kind_changes_its_own():
    by_kind = {one.kind: one for one in variations(0, 18.0) if one.percent == 100}
    changed = {
        kind: (
            found.moves_the_start,
            found.greys is not None,
            found.noise is not None,
            one.start_m > 0.0,
        )
        for kind, one in by_kind.items()
        for found in [one.disturbance(OFFICIAL)]
    }
    assert changed == {
        "start": (True, False, False, True),
        "light": (False, True, False, False),
        "colours": (False, True, False, False),
        "sensors": (False, False, True, False),
        "all": (True, True, True, True),
    }


def test_every_one_stands_on_every_league_track():
    for slug in ("oval", "baja-turnpike", "cosmic-circuit"):
        track = by_slug(slug).geometry()
        for one in variations(3, track.length):
            assert 0.0 <= one.start_m < track.length
            check_placed(track, one, OFFICIAL)


def test_one_that_cannot_be_placed_says_where():
    narrow = stadium(width=0.31)
    strongest = [one for seed in range(20) for one in variations(seed, narrow.length) if one.kind in (START, ALL)]
    with pytest.raises(UserFault) as refused:
        for one in strongest:
            check_placed(narrow, one, OFFICIAL)
    assert refused.value.code == "variation_not_placed"
    assert refused.value.params["track"] == "stadium" and refused.value.params["width_m"] == "0.31"


SPACE = ActionSpace.discrete([(0.0, 1.0)])
RULES = RaceRules(laps=1, max_resets=0, max_simulated_ms=2000)


def lap(disturbance=None, rules=RULES, seen=None, rivals=()):
    def straight_on(readings):
        if seen is not None:
            seen.append(readings["FRONT_FACING_CAMERA"])
        return np.zeros(1, np.float32)

    return run_race(
        RaceSettings(
            stadium(),
            rules,
            [Entrant(SPACE, ["FRONT_FACING_CAMERA"], straight_on), *rivals],
            disturbance=disturbance,
        )
    )


def test_a_race_under_a_variation_sees_and_starts_otherwise():
    (all_of_it,) = [one for one in variations(1, stadium().length) if (one.kind, one.percent) == (ALL, 100)]
    usual, other = [], []
    first = lap(seen=usual).trace
    second = lap(all_of_it.disturbance(OFFICIAL), dataclasses.replace(RULES, start_m=all_of_it.start_m), other).trace
    assert not np.array_equal(usual[0], other[0]) and first.sha256 != second.sha256


def test_noise_alone_leaves_the_drive_of_a_blind_car_as_it_is():
    (noise,) = [one for one in variations(1, 18.0) if (one.kind, one.percent) == (SENSORS, 100)]
    assert lap(noise.disturbance(OFFICIAL)).trace.sha256 == lap().trace.sha256


def test_several_cars_are_not_disturbed():
    (one, *_) = variations(0, 18.0)
    other = Entrant(SPACE, ["FRONT_FACING_CAMERA"], lambda readings: np.zeros(1, np.float32))
    with pytest.raises(ValueError, match="alone"):
        lap(one.disturbance(OFFICIAL), RaceRules(race_type=HEAD_TO_HEAD), rivals=[other])
