"""Lost time and its reasons: planted mistakes are found in their turn, and nothing else is."""

from itertools import pairwise

import numpy as np
import pytest

from paddock.analysis.losses import LARGEST, LEAST_MS, Mistake, losses_of, stretches_of
from tests.paddock.analysis.mistakes import (
    LATE_EXIT,
    SLOW,
    TRACKS,
    WIDE,
    drive,
    figures,
    good_lap,
    planted,
    telemetry_of,
    track_named,
)


@pytest.mark.slow
def test_planted_mistakes_are_found_in_their_turn_and_nothing_else():
    cases = [case for slug in TRACKS for case in planted(slug)]
    precision, recall, named = figures(cases)
    assert len(cases) >= 60
    assert precision >= 0.95 and recall >= 0.98 and named >= 0.95
    assert all(case.is_named for case in cases if case.mistake == LATE_EXIT)


def test_a_turn_that_the_start_of_the_lap_cuts_is_one_loss():
    (case,) = (case for case in planted("reinvent-2018", [LATE_EXIT]) if case.turn.number == 5)
    (loss,) = case.losses
    assert loss.ms == pytest.approx(case.cost_ms, rel=0.1)
    assert [reason for reason, _ in loss.reasons] == [Mistake.ACCELERATED_LATE]


@pytest.mark.parametrize("mistake", [SLOW, WIDE])
def test_a_mistake_in_one_turn_is_reported_for_that_turn_alone(mistake):
    cases = list(planted("oval-track", [mistake]))
    assert cases
    assert all(case.is_named and len(case.losses) == 1 for case in cases)


@pytest.mark.parametrize("slug", ["oval-track", "smile-speedway"])
def test_laps_without_a_mistake_have_no_losses(slug):
    run, (_, turns) = drive(slug, laps=3), track_named(slug)
    laps = [telemetry_of(slug, run, number) for number in (2, 3)]
    assert losses_of(*laps, turns) == losses_of(*reversed(laps), turns) == []


def test_a_slow_turn_costs_what_the_lap_lost():
    case = next(planted("oval-track", [SLOW]))
    (loss,) = case.losses
    assert loss.ms == pytest.approx(case.cost_ms, rel=0.1)
    reason, value = loss.reasons[0]
    assert reason == Mistake.BRAKED_TOO_MUCH
    assert value == pytest.approx(0.6, abs=0.1)  # as planted


def test_a_lap_that_gains_has_no_losses():
    case = next(planted("oval-track", [SLOW]))
    good, (_, turns) = good_lap("oval-track"), track_named("oval-track")
    slow = telemetry_of("oval-track", drive("oval-track", SLOW, case.turn))
    assert losses_of(slow, good, turns)
    assert losses_of(good, slow, turns) == []


def test_only_the_largest_losses_are_reported():
    slug = "rl-speedway"
    (_, turns), good = track_named(slug), good_lap(slug)
    slow = telemetry_of(slug, drive(slug, laps=2))
    slow.ms[:] = np.linspace(0, 5_000, len(slow.ms)) + slow.ms
    losses = losses_of(slow, good, turns)
    assert len(losses) == LARGEST
    assert [loss.ms for loss in losses] == sorted((loss.ms for loss in losses), reverse=True)
    assert losses[-1].ms >= LEAST_MS


def test_leaving_the_road_is_a_reason_of_its_own():
    slug = "oval-track"
    (_, turns), good = track_named(slug), good_lap(slug)
    lap = telemetry_of(slug, drive(slug))
    at = int(np.searchsorted(lap.metres, turns[1].apex_m))
    lap.ms[at:] += 2_000.0
    lap.faults.append((turns[1].apex_m, "off_track"))
    (loss,) = losses_of(lap, good, turns)
    assert (loss.stretch.turn, loss.ms) == (turns[1], 2_000)
    assert loss.reasons == [(Mistake.LEFT_ROAD, 2.0)]


@pytest.mark.parametrize("start_m", [0.0, 5.0, 8.2])
@pytest.mark.parametrize("slug", [*TRACKS, "straight-track"])
def test_stretches_cover_a_lap_without_gaps(slug, start_m):
    track, turns = track_named(slug)
    stretches = stretches_of(turns, track.length, start_m, is_open=track.is_open)
    ends = [(0.0, 0.0), *((each.from_m, each.to_m) for each in stretches), (track.length, track.length)]
    assert all(abs(after[0] - before[1]) <= 0.11 for before, after in pairwise(ends))
    assert {each.turn for each in stretches} - {None} == set(turns)
