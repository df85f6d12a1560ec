"""What the bar says at each moment of a run."""

from __future__ import annotations

import pytest

from tests.videos.drawing.runs import SMALL, car, driven, lap, scene, with_reset
from videos.drawing.panel import Panel
from videos.drawing.timeline import prepare
from videos.drawing.timing import FLASH_MS, GREEN, PURPLE, YELLOW, Timing, laps_of, written

THREE = [lap(1, 0, 9000), lap(2, 9000, 8700), lap(3, 17700, 9300)]


def test_the_clock_runs_during_a_lap_and_stops_at_its_end():
    timing = Timing(laps_of(THREE))
    assert [(timing.at(t).lap, timing.at(t).lap_ms) for t in (0, 8999, 9000, 12_000, 99_000)] == [
        (1, 0),
        (1, 8999),
        (2, 0),
        (2, 3000),
        (3, 9300),
    ]


def test_last_and_best_count_completed_laps_only():
    timing = Timing(laps_of(THREE))
    assert [(timing.at(t).last_ms, timing.at(t).best_ms) for t in (0, 9000, 17_700, 27_000)] == [
        (None, None),
        (9000, 9000),
        (8700, 8700),
        (9300, 8700),
    ]


def test_sectors_get_their_colours_when_completed():
    timing = Timing(laps_of(THREE), (2900, None, 3000))
    assert timing.at(2999).sectors == ()
    assert timing.at(3000).sectors == (GREEN,)
    assert timing.at(17_699).sectors[:2] == (PURPLE, GREEN)
    assert timing.at(27_000).sectors == (YELLOW, YELLOW, YELLOW)
    first, second, third = timing.laps
    assert [timing.final(one) for one in (first, second, third)] == [
        (YELLOW, YELLOW, PURPLE),
        (PURPLE, GREEN, PURPLE),
        (YELLOW,) * 3,
    ]


def test_a_lap_time_flashes_when_the_finish_line_is_crossed():
    timing = Timing(laps_of(THREE))
    assert timing.at(8999).flash is None
    assert (timing.at(9000).flash.number, timing.at(9000).flash_age_ms) == (1, 0)
    assert timing.at(9000 + FLASH_MS).flash is None


@pytest.mark.parametrize(
    ("moment", "only", "resets"), [(0, None, 0), (1999, None, 0), (2001, None, 1), (9000, None, 1), (3000, 1, 1)]
)
def test_resets_are_counted_from_the_moment_of_the_fault(moment, only, resets):
    rows = with_reset(driven(3.0), 30, 1.0, 2.0)
    panel = Panel(prepare(scene(car(rows, laps=[lap(1, 0, 6000, resets=1)]), lap=only), SMALL))
    assert panel._resets(moment) == resets


def test_the_fault_that_ends_a_run_is_no_reset():
    rows = with_reset(driven(3.0), 30, 1.0, 0.2)
    panel = Panel(prepare(scene(car(rows, laps=[lap(1, 0, 2000, complete=False)])), SMALL))
    assert panel._resets(9000) == 0


def test_the_clock_of_a_single_lap_stops_at_its_end():
    timing = Timing(laps_of(THREE))
    clock = timing.at(17_700, within=2)
    assert (clock.lap, clock.lap_ms, clock.sectors, clock.flash) == (2, 8700, (GREEN,) * 3, None)


def test_an_unfinished_lap_has_no_counting_time():
    timing = Timing(laps_of([lap(1, 0, 9000), lap(2, 9000, 500, complete=False)]))
    assert timing.at(20_000).best_ms == 9000
    assert timing.final(timing.laps[1]) == ()


def test_a_run_without_laps_shows_its_own_time():
    clock = Timing([]).at(1234.4)
    assert (clock.lap, clock.laps, clock.lap_ms) == (1, 0, 1234)


def test_invalid_laps_are_left_out():
    assert [one.number for one in laps_of([{}, {"number": "x"}, lap(4, 0, 1)])] == [4]


@pytest.mark.parametrize(
    ("time", "text"), [(0, "0:00.000"), (61_002, "1:01.002"), (None, "-"), (599_999.6, "10:00.000")]
)
def test_times_are_written_as_elsewhere_on_the_site(time, text):
    assert written(time) == text
