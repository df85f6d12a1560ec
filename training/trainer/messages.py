"""What the trainer's process may say, checked: sizes, types and ranges. No torch here."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Any

from paddock.rules.race import DIRECTIONS
from paddock.rules.training import MOST_TRACKS
from paddock.simulator.trace import COLUMNS, LABELS

from ..rewards.function import readable
from ..rewards.watch import KEPT_CHARACTERS, LAST_CHARACTERS
from .bounds import SIMTRACE_CSV, SIMTRACE_PACKED

_EPISODES, _TRIALS, _PLACES = 200, max(10, 2 * MOST_TRACKS), 400
GREATEST = 1e12
_LONGEST_CALL_MS = 1e6
_HEADER = (",".join(COLUMNS) + "\n").encode()


@dataclass(frozen=True)
class Iteration:
    """One look at the car: see ``training.models.TrainingIteration`` for the names. ``driving``: [[x, y, yaw, speed],
    ...]; ``onnx``: the policy as it is; ``simtrace``: a gzipped CSV or nothing."""

    values: dict[str, Any]
    driving: list[list[float]]
    onnx: bytes
    simtrace: bytes


@dataclass(frozen=True)
class SavedState:
    """A checkpoint: bytes that only the trainer reads again."""

    iteration: int
    steps: int
    seconds: float
    state: bytes


@dataclass(frozen=True)
class Ended:
    """How a training ended by itself: ``why`` is clean_laps, time, steps or stopped.

    ``sb3_zip``: ``b""`` where it did not end although it was told to, or its time was up: it was cut off.
    ``network``: the policy as it is, where the training ended before its first iteration; else ``b""``. ``reward_ms``:
    milliseconds of a call of the reward function, on the average.
    """

    why: str
    steps: int
    seconds: float
    sb3_zip: bytes
    network: bytes = b""
    reward_ms: float | None = None


@dataclass(frozen=True)
class Prints:
    """What a reward function printed since the last time: see :meth:`training.rewards.watch.Watch.news`; lines that
    may be shown."""

    kept: str
    last: str
    more: bool


@dataclass(frozen=True)
class Sight:
    """What a car sees while it drives, and what the policy would do: ``picture`` is grey, 120 rows of 160 bytes;
    degrees (positive is left), m/s, and what it expects to earn from there on (None: beyond what can be told)."""

    picture: bytes
    steering: float
    speed: float
    value: float | None


SIGHT_ROWS, SIGHT_COLUMNS = 120, 160


def sight_of(said: dict[str, Any], blobs: list[bytes]) -> Sight:
    """What was said, if it has the form and the size of a sight. Raises KeyError, TypeError, ValueError."""
    (picture,) = blobs
    if len(picture) != SIGHT_ROWS * SIGHT_COLUMNS:
        raise ValueError("no picture")
    value = None if said["value"] is None else number(said["value"])
    return Sight(picture, number(said["steering"]), number(said["speed"]), value)


def prints_of(said: dict[str, Any]) -> Prints:
    """What was said, if it has the form and the size of prints. Raises KeyError, TypeError, ValueError."""
    kept, last = said["kept"], said["last"]
    if not (isinstance(kept, str) and isinstance(last, str)):
        raise ValueError("no text")
    if len(kept) > KEPT_CHARACTERS or len(last) > LAST_CHARACTERS:
        raise ValueError("too much text")
    return Prints(readable(kept), readable(last), said["more"] is True)


def reward_ms_of(said: dict[str, Any]) -> float | None:
    """Milliseconds of a call of the reward function, if they were reported. Raises ValueError."""
    milliseconds = said.get("reward_ms")
    if milliseconds is None:
        return None
    if not 0.0 <= number(milliseconds) <= _LONGEST_CALL_MS:
        raise ValueError("no time of a call")
    return float(milliseconds)


def iteration_of(message: dict[str, Any], blobs: list[bytes], network_limit: int) -> Iteration:
    """What was said, if it has the form and the size of an iteration. ``network_limit``: bytes of its network.

    Raises KeyError, TypeError, ValueError."""
    said = message["iteration"]
    onnx, simtrace = blobs
    if not 0 < len(onnx) <= network_limit:
        raise ValueError("no network")
    if simtrace and not _is_trace(simtrace):
        raise ValueError("no sim-trace")
    values = {
        "number": whole(said["number"], 1),
        "steps": whole(said["steps"]),
        "seconds": number(said["seconds"]),
        "steps_per_second": number(said["steps_per_second"]),
        "episodes": [_episode(one) for one in said["episodes"][:_EPISODES]],
        "eval_trials": [_episode(one) for one in said["eval_trials"][:_TRIALS]],
        "eval_progress": min(max(number(said["eval_progress"]), 0.0), 100.0),
        "eval_reward": number(said["eval_reward"]),
        "eval_lap_ms": None if said["eval_lap_ms"] is None else whole(said["eval_lap_ms"]),
        "eval_clean_laps": min(whole(said["eval_clean_laps"]), _TRIALS),
        "is_best": said["is_best"] is True,
    }
    for name in ("mean_reward", "mean_progress", "entropy", "policy_loss", "value_loss"):
        values[name] = None if said[name] is None else number(said[name])
    driving = [[number(value) for value in place[:4]] for place in message["driving"][:_PLACES]]
    return Iteration(values, driving, onnx, simtrace)


def _is_trace(packed: bytes) -> bool:
    """Whether it is a gzipped sim-trace of the size that ours have: it is unpacked again where it is downloaded."""
    if len(packed) > SIMTRACE_PACKED:
        return False
    unpacking = zlib.decompressobj(wbits=31)  # gzip's form
    try:
        csv = unpacking.decompress(packed, SIMTRACE_CSV)
    except zlib.error:
        return False
    return unpacking.eof and not unpacking.unused_data and csv.startswith(_HEADER)


def _episode(said: dict[str, Any]) -> dict[str, Any]:
    known = {
        "reward": number(said["reward"]),
        "progress": min(max(number(said["progress"]), 0.0), 100.0),
        "status": said["status"] if said["status"] in LABELS.values() else LABELS["in_progress"],
        "steps": whole(said["steps"]),
        "time_ms": whole(said["time_ms"]),
    }
    for name in ("episode", "lap_ms"):
        if name in said:
            known[name] = None if said[name] is None else whole(said[name])
    if "track" in said:
        known["track"] = min(whole(said["track"]), MOST_TRACKS - 1)
        known["direction"] = said["direction"] if said["direction"] in DIRECTIONS else DIRECTIONS[0]
    return known


def number(value: Any) -> float:
    """A finite number of ordinary size. Raises ValueError."""
    if type(value) not in (int, float) or not math.isfinite(value) or abs(value) > GREATEST:
        raise ValueError("not a number")
    return float(value)


def whole(value: Any, least: int = 0) -> int:
    """A whole number that the database takes. Raises ValueError."""
    if type(value) is not int or not least <= value <= 2**31 - 1:
        raise ValueError("not a whole number")
    return value
