"""Where a lap lost time to another, and by which mistake, by the rules of docs/analysis.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from .telemetry import GRID_M, LapTelemetry
from .turns import TrackTurn

APPROACH_M, EXIT_M = 1.5, 1.5  # of a turn's stretch before and after the turn itself
TURN_IN_M = 1.0  # from a turn's entry, where a car turns in
STRAIGHT_M = 1.5  # the least length of a stretch between two turns
LEAST_MS = 60.0  # of a loss
LARGEST = 3  # losses that are reported
REASONS = 2  # of a loss
AFTERMATH = 0.5  # of a loss, the most that the stretches up to the end of the next turn may lose because of it
SHARE = 0.35  # of the lost time, the least that a reason's kind must explain


class Mistake(StrEnum):
    """The reason of a loss, in the order in which a turn has them. Its value is in metres, for speeds in m/s."""

    LEFT_ROAD = "left_road"
    CRASHED = "crashed"
    STOPPED = "stopped"
    ENTERED_WIDE = "entered_wide"
    ENTERED_TIGHT = "entered_tight"
    BRAKED_EARLY = "braked_early"
    TURNED_LATE = "turned_late"
    TURNED_EARLY = "turned_early"
    BRAKED_TOO_MUCH = "braked_too_much"
    RAN_WIDE = "ran_wide"
    ACCELERATED_LATE = "accelerated_late"
    SLOWER = "slower"
    LONGER = "longer"


# The least value that counts. SLOWER and LONGER explain what is left.
LEAST = {
    Mistake.ENTERED_WIDE: 0.12,
    Mistake.ENTERED_TIGHT: 0.12,
    Mistake.RAN_WIDE: 0.12,
    Mistake.TURNED_LATE: 0.25,
    Mistake.TURNED_EARLY: 0.25,
    Mistake.BRAKED_TOO_MUCH: 0.15,
    Mistake.BRAKED_EARLY: 0.3,
    Mistake.ACCELERATED_LATE: 0.3,
    Mistake.SLOWER: 0.05,
    Mistake.LONGER: 0.05,
}


@dataclass(frozen=True)
class Stretch:
    """A part of a lap from ``from_m`` to ``to_m``, metres from its start: ``turn`` with its approach and exit, None for
    a straight after turn ``after`` (0: before the first)."""

    from_m: float
    to_m: float
    turn: TrackTurn | None
    after: int


@dataclass(frozen=True)
class Loss:
    """Time lost on a stretch, in ms, and at most two reasons with their values; ``moment_ms``: since the lap's start,
    when the car came to the stretch."""

    stretch: Stretch
    ms: int
    reasons: list[tuple[Mistake, float]]
    moment_ms: int


def stretches_of(
    turns: Sequence[TrackTurn], length_m: float, start_m: float = 0.0, *, is_open: bool = False
) -> list[Stretch]:
    """A lap that begins ``start_m`` metres after the finish, cut into its turns and straights without gaps. What
    crosses the start has two stretches."""
    if not turns:
        return [Stretch(0.0, length_m, None, 0)]
    ends = []
    for turn, following in zip(turns, [*turns[1:], turns[0]], strict=True):
        room = (following.from_m - turn.to_m) % length_m
        if room >= APPROACH_M + EXIT_M + STRAIGHT_M:
            ends.append((turn.to_m + EXIT_M, following.from_m - APPROACH_M))
        else:
            ends.append((turn.to_m + room * EXIT_M / (APPROACH_M + EXIT_M),) * 2)
    around = []
    for turn, (_, before), (begin, end) in zip(turns, [ends[-1], *ends[:-1]], ends, strict=True):
        around += [(before, begin, turn, turn.number), (begin, end, None, turn.number)]
    found = []
    for first, last, of_turn, after in around:
        first, last = (first - start_m) % length_m, (last - start_m) % length_m
        if first <= last:
            found.append(Stretch(first, last, of_turn, after))
        else:
            begins = (None, 0) if is_open else (of_turn, after)
            found += [Stretch(first, length_m, of_turn, after), Stretch(0.0, last, *begins)]
    return sorted((each for each in found if each.to_m - each.from_m > GRID_M), key=lambda each: each.from_m)


def losses_of(
    mine: LapTelemetry,
    other: LapTelemetry,
    turns: Sequence[TrackTurn],
    start_m: float = 0.0,
    *,
    is_open: bool = False,
) -> list[Loss]:
    """The largest losses of a lap to another of the same grid, the largest first."""
    length_m = float(mine.metres[-1])
    losses: list[Loss] = []
    turns_after = 0  # the last loss
    stretches = stretches_of(turns, length_m, start_m, is_open=is_open)
    first, last = stretches[0], stretches[-1]
    is_cut = first is not last and first.turn is not None and first.turn == last.turn
    for stretch in stretches:
        least = LEAST_MS / 2 if is_cut and stretch in (first, last) else LEAST_MS
        loss = _loss(mine, other, stretch, start_m, least)
        turns_after += stretch.turn is not None
        if loss is None:
            continue
        if losses and turns_after < 2 and _is_aftermath(loss, losses[-1]):
            losses[-1] = replace(losses[-1], ms=losses[-1].ms + loss.ms)
        else:
            losses.append(loss)
            turns_after = 0
    if is_cut and len(losses) > 1 and (losses[0].stretch, losses[-1].stretch) == (first, last):
        losses = [_joined(losses[0], losses[-1]), *losses[1:-1]]
    return sorted((loss for loss in losses if loss.ms >= LEAST_MS), key=lambda loss: -loss.ms)[:LARGEST]


def _joined(one: Loss, other: Loss) -> Loss:
    """The losses of the two parts of a turn that the start of the lap cuts, at the larger one's place."""
    larger, smaller = (one, other) if one.ms >= other.ms else (other, one)
    reasons = (larger.reasons + [each for each in smaller.reasons if each[0] not in dict(larger.reasons)])[:REASONS]
    return replace(larger, ms=one.ms + other.ms, reasons=reasons)


def _is_aftermath(loss: Loss, before: Loss) -> bool:
    """Whether a loss follows from the one before: it is much smaller, in the same turn, or on the straight behind a
    turn that the car left too slowly."""
    same = loss.stretch.turn is not None and loss.stretch.turn == before.stretch.turn
    slow_exit = loss.stretch.turn is None and Mistake.ACCELERATED_LATE in dict(before.reasons)
    return loss.ms < AFTERMATH * before.ms or same or slow_exit


def _loss(mine: LapTelemetry, other: LapTelemetry, stretch: Stretch, start_m: float, least_ms: float) -> Loss | None:
    reached = min(stretch.to_m, mine.reached_m, other.reached_m)
    rows = np.flatnonzero((mine.metres >= stretch.from_m - 1e-9) & (mine.metres <= reached + 1e-9))
    if len(rows) < 2:
        return None
    spent, theirs = np.diff(mine.ms[rows]), np.diff(other.ms[rows])
    lost = float(spent.sum() - theirs.sum())
    if lost < least_ms:
        return None
    faults = [status for metres, status in mine.faults if stretch.from_m - GRID_M <= metres < stretch.to_m - GRID_M]
    reasons = [(_FAULTS.get(faults[0], Mistake.STOPPED), lost / 1000.0)] if faults else []
    if not reasons:
        reasons = _reasons(mine, other, stretch, rows, spent, theirs, start_m)
    return Loss(stretch, round(lost), reasons, round(float(mine.ms[rows[0]])))


_FAULTS = {"off_track": Mistake.LEFT_ROAD, "crashed": Mistake.CRASHED}


def _reasons(
    mine: LapTelemetry,
    other: LapTelemetry,
    stretch: Stretch,
    rows: np.ndarray,
    spent: np.ndarray,
    theirs: np.ndarray,
    start_m: float,
) -> list[tuple[Mistake, float]]:
    """The mistakes that explain a loss: those of the line if the car drove farther, those of the speed if it drove
    slower."""
    cells = [(each.driven_speed[rows][:-1] + each.driven_speed[rows][1:]) / 2 for each in (mine, other)]
    way, their_way = cells[0] * spent / 1000.0, cells[1] * theirs / 1000.0
    pace = their_way.sum() / theirs.sum() * 1000.0
    lost_s = (spent.sum() - theirs.sum()) / 1000.0
    farther_m = float(way.sum() - their_way.sum())
    by_line = farther_m / pace / lost_s
    turn = stretch.turn
    found: list[tuple[Mistake, float]] = []
    if turn is not None:
        if by_line >= SHARE:
            found += _of_line(mine, other, rows, turn, start_m)
        if 1.0 - by_line >= SHARE:
            found += _of_speed(mine, other, rows, turn, start_m, is_exit=stretch.from_m == 0.0)
    found = sorted(
        ((mistake, value) for mistake, value in found if value >= LEAST[mistake]),
        key=lambda each: -each[1] / LEAST[each[0]],
    )
    if found:
        return sorted(found[:REASONS], key=lambda each: list(Mistake).index(each[0]))
    slower = pace - float(way.sum() / spent.sum() * 1000.0)
    return [(Mistake.LONGER, farther_m) if by_line > 0.5 else (Mistake.SLOWER, slower)]


def _of_line(
    mine: LapTelemetry, other: LapTelemetry, rows: np.ndarray, turn: TrackTurn, start_m: float
) -> Iterator[tuple[Mistake, float]]:
    side = 1.0 if turn.degrees > 0 else -1.0
    outwards = -side * (mine.offset[rows] - other.offset[rows])
    metres = mine.metres[rows]
    entry, apex = (_row(metres, each, start_m, mine) for each in (turn.from_m, turn.apex_m))
    wide = 0.0
    if entry is not None:
        wide = float(outwards[entry])
        yield Mistake.ENTERED_WIDE, wide
        yield Mistake.ENTERED_TIGHT, -wide
    near = np.abs(metres - metres[entry]) <= TURN_IN_M if entry is not None else np.zeros(len(rows), bool)
    demand = [side * each.driven_steer[rows][near] for each in (mine, other)]
    # after another entry the car has to turn elsewhere
    if near.any() and abs(wide) < LEAST[Mistake.ENTERED_WIDE] and (half := float(demand[1].max()) / 2) > 0:
        turned = [int(np.argmax(each >= half)) if each.max() >= half else len(each) for each in demand]
        late = (turned[0] - turned[1]) * float(metres[1] - metres[0])
        yield Mistake.TURNED_LATE, late
        yield Mistake.TURNED_EARLY, -late
    if apex is not None:
        yield Mistake.RAN_WIDE, float(outwards[apex]) - max(wide, 0.0)


def _of_speed(
    mine: LapTelemetry, other: LapTelemetry, rows: np.ndarray, turn: TrackTurn, start_m: float, *, is_exit: bool
) -> Iterator[tuple[Mistake, float]]:
    """``is_exit``: the stretch begins with the lap."""
    metres = mine.metres[rows]
    speed, their = mine.driven_speed[rows], other.driven_speed[rows]
    slowest, their_slowest = int(speed.argmin()), int(their.argmin())
    if is_exit and _row(metres, turn.apex_m, start_m, mine) is None:
        their_slowest = 0  # the turn lies before the line: nobody brakes for it here
    else:
        yield Mistake.BRAKED_TOO_MUCH, float(their[their_slowest] - speed[slowest])
        braked, they_braked = (_braked_at(each) for each in (speed, their))
        if braked is not None and they_braked is not None:
            yield Mistake.BRAKED_EARLY, float(metres[they_braked] - metres[braked])
    # behind the slowest place, the way on which the other was fast again and this one was not
    behind = slice(their_slowest, None)
    fast = 0.95 * their[-1]
    late = (speed[behind] < fast) & (their[behind] >= fast)
    yield Mistake.ACCELERATED_LATE, float(late.sum() * (metres[1] - metres[0]))


def _braked_at(speed: np.ndarray) -> int | None:
    """The row at which half of the braking before the slowest place is done."""
    slowest = int(speed.argmin())
    fastest = int(speed[: slowest + 1].argmax())
    if speed[fastest] - speed[slowest] < 0.3:
        return None
    half = (speed[fastest] + speed[slowest]) / 2
    return fastest + int(np.argmax(speed[fastest : slowest + 1] <= half))


def _row(metres: np.ndarray, place: float, start_m: float, mine: LapTelemetry) -> int | None:
    """The row of a place of the track, None outside of the stretch."""
    at = (place - start_m) % float(mine.metres[-1])
    return int(np.abs(metres - at).argmin()) if metres[0] - GRID_M <= at <= metres[-1] + GRID_M else None
