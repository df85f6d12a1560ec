"""The telemetry document: a lap of each of several runs on one grid of distance, mini-sectors and losses."""

import gzip
import json
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypedDict

import numpy as np
from django.utils.translation import get_language, gettext_lazy
from django.utils.translation import gettext as _

from paddock.analysis.losses import Loss, Mistake, losses_of
from paddock.analysis.mini_sectors import MINI_SECTORS, RunPace, mini_sector_times, pace_of, sector_colours
from paddock.analysis.telemetry import (
    DrivenTrace,
    Excursion,
    LapLine,
    LapTelemetry,
    excursions,
    lap_line,
    lap_telemetry,
    start_of,
)
from paddock.analysis.turns import TrackTurn, turns_of
from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.simulator.results import LapDocument
from races.replays.responses import compressed
from tracks.models import Track

from .rewards import RewardFunction

TELEMETRY_FORMAT = 2
DIGITS = {"speed": 2, "driven_speed": 2, "steer": 1, "driven_steer": 1, "offset": 3, "curvature": 3, "reward": 4}

REASONS = {
    Mistake.LEFT_ROAD: gettext_lazy("left the road"),
    Mistake.CRASHED: gettext_lazy("crashed"),
    Mistake.STOPPED: gettext_lazy("stopped or turned round"),
    Mistake.ENTERED_WIDE: gettext_lazy("entered %s m wide"),
    Mistake.ENTERED_TIGHT: gettext_lazy("entered %s m tight"),
    Mistake.BRAKED_EARLY: gettext_lazy("braked %s m early"),
    Mistake.TURNED_LATE: gettext_lazy("turned in %s m late"),
    Mistake.TURNED_EARLY: gettext_lazy("turned in %s m early"),
    Mistake.BRAKED_TOO_MUCH: gettext_lazy("braked %s m/s too much"),
    Mistake.RAN_WIDE: gettext_lazy("ran %s m wide"),
    Mistake.ACCELERATED_LATE: gettext_lazy("accelerated %s m late"),
    Mistake.SLOWER: gettext_lazy("drove %s m/s slower"),
    Mistake.LONGER: gettext_lazy("drove %s m farther"),
}
_FINE = (Mistake.SLOWER, Mistake.LONGER)  # their values are small


class LapTurnDocument(TypedDict):
    """A turn of the track, metres from the start of a lap: ``to_m`` is less than ``from_m`` across the start."""

    number: int
    from_m: float
    apex_m: float
    to_m: float
    degrees: Annotated[float, "Above 0 to the left."]


class ExcursionDocument(TypedDict):
    """A stretch with a wheel beyond the border."""

    lap: int
    from_m: float
    to_m: float
    t_ms: Annotated[int, "Since the run's start."]
    turn: Annotated[int | None, "The turn where it began; null on a straight."]
    reset: Annotated[bool, "The referee put the car back, or ended the run."]


class RunTelemetryDocument(TypedDict):
    """A lap of a run, and the run's laps together. Each list has a value for each of ``metres``, null where the lap did
    not come."""

    run: Annotated[str, "Its public id; `reference` for the reference lap of the track."]
    name: str
    lap: int
    start_ms: Annotated[int, "Of the lap, since the run's start."]
    time_ms: Annotated[int | None, "Null for a lap that was not finished."]
    ms: Annotated[list[int | None], "Since the lap's start."]
    delta_ms: Annotated[list[int | None], "How much later than the first run it was there."]
    speed: Annotated[list[float | None], "Commanded, m/s."]
    driven_speed: Annotated[list[float | None], "m/s."]
    steer: Annotated[list[float | None], "Commanded, degrees to the left."]
    driven_steer: Annotated[list[float | None], "The angle of the driven curvature."]
    offset: Annotated[list[float | None], "Metres to the left of the centre line, of the nose."]
    curvature: Annotated[list[float | None], "Of the driven path, 1/m, above 0 to the left."]
    reward: Annotated[
        list[float | None] | None,
        "With `reward=1`: of each step, by the function of the training that made the model; null unless you see it.",
    ]
    best_ms: Annotated[int | None, "The theoretical best lap: the sum of the fastest times in all mini-sectors."]
    laps: Annotated[int, "Complete ones."]
    mean_ms: Annotated[int | None, "Their mean time."]
    deviation_ms: Annotated[int | None, "The standard deviation of their times; null for fewer than two."]
    least_consistent: Annotated[int | None, "The mini-sector whose times deviate most."]
    off_road: list[ExcursionDocument]


class MiniSectorDocument(TypedDict):
    """A twentieth of a lap. ``times`` and ``colours``: of the shown laps, in the order of ``runs``."""

    number: int
    from_m: float
    to_m: float
    times: list[int | None]
    colours: Annotated[
        list[str],
        "purple: the fastest of all runs; green: the run's own fastest; yellow: slower; empty without a time.",
    ]


class LossReasonDocument(TypedDict):
    """A reason of a loss."""

    mistake: str
    value: Annotated[float, "Metres; for speeds m/s, for faults seconds."]


class LossDocument(TypedDict):
    """Time that the first lap lost on a stretch."""

    turn: Annotated[int | None, "Null on a straight."]
    after: Annotated[int, "The turn before a straight; 0 for none."]
    from_m: float
    to_m: float
    ms: int
    t_ms: Annotated[int, "When the car came to the stretch, since the lap's start."]
    reasons: list[LossReasonDocument]
    sentence: Annotated[str, "In your language."]


class ComparedLapDocument(TypedDict):
    """The lap that losses are measured against."""

    run: str
    lap: int


class TelemetryDocument(TypedDict):
    """Laps side by side along their way."""

    track: str
    direction: str
    length_m: float
    metres: Annotated[list[float], "From the start of a lap."]
    turns: list[LapTurnDocument]
    runs: list[RunTelemetryDocument]
    sectors: list[MiniSectorDocument]
    losses: Annotated[list[LossDocument], "The three largest of the first run's lap, the largest first."]
    against: Annotated[
        ComparedLapDocument | None, "The second run's lap, else the first run's own best; null for none."
    ]


@dataclass(frozen=True)
class AskedLap:
    """Lap ``number`` of a run with its ``laps``, and the run's id and name in the document; ``read``: its steps;
    ``rewards``: the reward of each step, on request."""

    run: str
    name: str
    number: int
    track: Track
    direction: str
    laps: Sequence[LapDocument]
    trace_sha256: str
    read: Callable[[], DrivenTrace]
    rewards: RewardFunction | None = None


@dataclass(frozen=True)
class _Laps:
    """A run as it was driven: all of its laps, and the telemetry of one."""

    asked: AskedLap
    start_m: float
    lines: dict[int, LapLine]
    trace: DrivenTrace
    lap: LapTelemetry
    pace: RunPace
    off_road: list[Excursion]


def telemetry_document(laps: Sequence[AskedLap]) -> TelemetryDocument:
    """The document of these laps, the first run's first; all were driven on one track in one direction. Made once for
    all readers of a language. Raises UserFault ``compare_lap``, PlatformFault ``storage_failed``, ``file_damaged``."""
    return json.loads(gzip.decompress(compressed(*telemetry_part(laps))))


def telemetry_part(laps: Sequence[AskedLap]) -> tuple[Hashable, Callable[[], TelemetryDocument]]:
    """The key of the document in the language at hand, and what makes it."""
    return (document_key(laps), get_language()), lambda: _document(laps)


def document_key(laps: Sequence[AskedLap]) -> tuple[Any, ...]:
    """Everything that a document is made of, but for the language."""
    runs = ((lap.run, lap.trace_sha256, lap.number, lap.name, lap.rewards and lap.rewards.key) for lap in laps)
    return "telemetry", TELEMETRY_FORMAT, laps[0].track.slug, laps[0].direction, *runs


def _document(laps: Sequence[AskedLap]) -> TelemetryDocument:
    first = laps[0]
    track = first.track.geometry.in_direction(first.direction)
    runs = [_driven(lap, track) for lap in laps]
    turns = turns_of(track, track.direction)
    one = runs[0]
    other = runs[1].lap if len(runs) > 1 else _own_best(one, track)
    against = runs[1].asked.run if len(runs) > 1 else first.run
    losses = losses_of(one.lap, other, turns, one.start_m, is_open=track.is_open) if other else []
    return {
        "track": first.track.slug,
        "direction": track.direction,
        "length_m": round(track.length, 3),
        "metres": np.round(one.lap.metres, 2).tolist(),
        "turns": [_turn(turn, one.start_m, track.length) for turn in turns],
        "runs": [_run(run, one, turns, track.length) for run in runs],
        "sectors": _sectors(runs, track.length),
        "losses": [_loss(loss) for loss in losses],
        "against": {"run": against, "lap": other.number} if other else None,
    }


def _driven(asked: AskedLap, track: TrackGeometry) -> _Laps:
    trace = asked.read()
    if asked.rewards is not None:
        trace = _rewarded(trace, asked.number, asked.rewards)
    lines = {
        lap["number"]: line for lap in asked.laps if (line := lap_line(trace, asked.laps, lap["number"])) is not None
    }
    if asked.number not in lines:
        raise UserFault("compare_lap", lap=asked.number, laps=len(asked.laps))
    lap = lap_telemetry(trace, lines[asked.number], track)
    off_road = excursions(trace, track.length)
    return _Laps(asked, start_of(trace, track), lines, trace, lap, pace_of(list(lines.values())), off_road)


def _rewarded(trace: DrivenTrace, lap: int, function: RewardFunction) -> DrivenTrace:
    """A trace with the rewards of a lap; a step without one has that of the next."""
    rewards = np.full(len(trace.ms), np.nan)
    known = function.along(lap)
    rows = np.array(sorted(known), int)
    rewards[rows] = [known[row] for row in rows.tolist()]
    if len(rows):
        steps = np.flatnonzero(trace.lap == lap)
        following = np.searchsorted(rows, steps).clip(max=len(rows) - 1)
        rewards[steps] = rewards[rows[following]]
    return replace(trace, reward=rewards)


def _own_best(run: _Laps, track: TrackGeometry) -> LapTelemetry | None:
    """The fastest lap of a run beside the one that is shown, None where that is the fastest."""
    whole = [line for line in run.lines.values() if line.time_ms is not None]
    best = min(whole, key=lambda line: line.time_ms or 0, default=None)
    return None if best is None or best.number == run.lap.number else lap_telemetry(run.trace, best, track)


def _turn(turn: TrackTurn, start_m: float, length_m: float) -> LapTurnDocument:
    from_m, apex_m, to_m = (round((metres - start_m) % length_m, 2) for metres in (turn.from_m, turn.apex_m, turn.to_m))
    return {"number": turn.number, "from_m": from_m, "apex_m": apex_m, "to_m": to_m, "degrees": turn.degrees}


def _run(run: _Laps, first: _Laps, turns: Sequence[TrackTurn], length_m: float) -> RunTelemetryDocument:
    lap, pace = run.lap, run.pace
    channels: dict[str, object] = {
        name: None if (values := getattr(lap, name)) is None else _numbers(values, digits)
        for name, digits in DIGITS.items()
    }
    return {
        "run": run.asked.run,
        "name": run.asked.name,
        "lap": lap.number,
        "start_ms": lap.start_ms,
        "time_ms": lap.time_ms,
        "ms": _whole(lap.ms),
        "delta_ms": _whole(lap.ms - first.lap.ms),
        **channels,  # type: ignore[typeddict-item]
        "best_ms": pace.best_ms,
        "laps": pace.laps,
        "mean_ms": pace.mean_ms,
        "deviation_ms": pace.deviation_ms,
        "least_consistent": None if pace.least_consistent is None else pace.least_consistent + 1,
        "off_road": [_excursion(each, turns, run.start_m, length_m) for each in run.off_road],
    }


def _excursion(each: Excursion, turns: Sequence[TrackTurn], start_m: float, length_m: float) -> ExcursionDocument:
    at = (each.from_m + start_m) % length_m
    return {
        "lap": each.lap,
        "from_m": round(each.from_m, 2),
        "to_m": round(each.to_m, 2),
        "t_ms": each.ms,
        "turn": next((turn.number for turn in turns if turn.contains(at)), None),
        "reset": each.reset,
    }


def _sectors(runs: Sequence[_Laps], length_m: float) -> list[MiniSectorDocument]:
    times = [mini_sector_times(run.lines[run.lap.number]) for run in runs]
    own = [run.pace.fastest for run in runs]
    best = np.fmin.reduce(own) if len(runs) > 1 else None
    colours = [sector_colours(time, mine, best) for time, mine in zip(times, own, strict=True)]
    rows = zip(*map(_whole, times), strict=True), zip(*colours, strict=True)
    return [
        {
            "number": number,
            "from_m": round((number - 1) * length_m / MINI_SECTORS, 2),
            "to_m": round(number * length_m / MINI_SECTORS, 2),
            "times": list(spent),
            "colours": list(shown),
        }
        for number, (spent, shown) in enumerate(zip(*rows, strict=True), 1)
    ]


def _loss(loss: Loss) -> LossDocument:
    stretch = loss.stretch
    return {
        "turn": stretch.turn.number if stretch.turn else None,
        "after": stretch.after,
        "from_m": round(stretch.from_m, 2),
        "to_m": round(stretch.to_m, 2),
        "ms": loss.ms,
        "t_ms": loss.moment_ms,
        "reasons": [{"mistake": mistake.value, "value": round(float(value), 2)} for mistake, value in loss.reasons],
        "sentence": loss_sentence(loss),
    }


def _numbers(values: np.ndarray, digits: int) -> list[float | None]:
    return [None if np.isnan(value) else value for value in np.round(values, digits).tolist()]


def _whole(values: np.ndarray) -> list[int | None]:
    return [None if np.isnan(value) else int(value) for value in np.round(values).tolist()]


def loss_sentence(loss: Loss) -> str:
    """Such as "0.82 s lost in turn 4: entered 0.3 m wide, braked 0.4 m/s too much"."""
    stretch, reasons = loss.stretch, []
    for mistake, value in loss.reasons:
        text = str(REASONS[mistake])
        reasons.append(text % f"{value:.{2 if mistake in _FINE else 1}f}" if "%s" in text else text)
    values = {"time": f"{loss.ms / 1000:.2f}", "turn": stretch.after, "reasons": ", ".join(reasons)}
    if stretch.turn is not None:
        return _("%(time)s s lost in turn %(turn)s: %(reasons)s") % (values | {"turn": stretch.turn.number})
    if stretch.after:
        return _("%(time)s s lost on the straight after turn %(turn)s: %(reasons)s") % values
    return _("%(time)s s lost on the straight: %(reasons)s") % values
