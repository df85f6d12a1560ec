"""The messages of the trainer's process, checked for sizes, types and ranges. Imports no torch."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypedDict, TypeVar

from paddock.rules.race import DIRECTIONS
from paddock.rules.training import MOST_TRACKS
from paddock.simulator.trace import COLUMNS, LABELS

from ..rewards.sandbox.call_limits import KEPT_CHARACTERS, LAST_CHARACTERS
from ..rewards.sandbox.function import readable
from .network import NetworkLayout
from .spec import TrainerSpec

# Measured with both algorithms, all depths, one camera and two: a network is its weights and less than 2 kB; a
# checkpoint and stable-baselines3's file are 3.0 to 3.2 times the weights with PPO (Adam has two numbers for each) and
# 7.1 to 8.6 times with SAC, whose two critics each have their own, and less than 0.15 MB; a guide is 0.5 MB.
_FLOAT = 4  # bytes
_TIMES = {"ppo": 3.2, "sac": 9.0}
_NETWORK_ROOM, _STATE_ROOM = 64 * 1024, 1024 * 1024
SIMTRACE_PACKED, SIMTRACE_CSV = 1024 * 1024, 2 * 1024 * 1024  # 6000 rows are 0.3 and 1.2 MB
_EPISODES, _TRIALS, _PLACES = 200, max(10, 2 * MOST_TRACKS), 400
GREATEST = 1e12
_LONGEST_CALL_MS = 1e6
_HEADER = (",".join(COLUMNS) + "\n").encode()


class EpisodeReport(TypedDict, total=False):
    """An episode, or a trial of an evaluation (with ``lap_ms``, without ``episode``). ``track`` and ``direction``: only
    where a training drives several ways."""

    episode: int | None
    reward: float
    progress: float
    status: str
    steps: int
    time_ms: int
    lap_ms: int | None
    track: int
    direction: str


class IterationReport(TypedDict):
    """The columns of a ``training.models.TrainingIteration``."""

    number: int
    steps: int
    seconds: float
    steps_per_second: float
    episodes: list[EpisodeReport]
    mean_reward: float | None
    mean_progress: float | None
    eval_trials: list[EpisodeReport]
    eval_progress: float
    eval_reward: float
    eval_lap_ms: int | None
    eval_clean_laps: int
    entropy: float | None
    policy_loss: float | None
    value_loss: float | None
    is_best: bool


@dataclass(frozen=True)
class Iteration:
    """An iteration. ``driving``: [[x, y, yaw, speed], ...]; ``onnx``: the policy; ``simtrace``: a gzipped CSV or
    nothing."""

    values: IterationReport
    driving: list[list[float]]
    onnx: bytes
    simtrace: bytes


@dataclass(frozen=True)
class SavedState:
    """A checkpoint: bytes for the trainer alone."""

    iteration: int
    steps: int
    seconds: float
    state: bytes


@dataclass(frozen=True)
class Ended:
    """The end of a training: ``why`` is clean_laps, time, steps or stopped.

    ``sb3_zip``: ``b""`` if the training was cut off, because it did not end on request or at its time limit.
    ``network``: the policy, where the training ended before its first iteration, else ``b""``. ``reward_ms``: mean
    milliseconds of a call of the reward function.
    """

    why: str
    steps: int
    seconds: float
    sb3_zip: bytes
    network: bytes = b""
    reward_ms: float | None = None


@dataclass(frozen=True)
class Prints:
    """Printable lines that a reward function printed since the last message
    (:meth:`training.rewards.sandbox.call_limits.Watch.news`)."""

    kept: str
    last: str
    more: bool


@dataclass(frozen=True)
class Sight:
    """A car's camera picture and the policy's output: ``picture`` is grey, 120 rows of 160 bytes; degrees (positive is
    left), m/s, and ``value``, the expected reward from there on (None: too large to report)."""

    picture: bytes
    steering: float
    speed: float
    value: float | None


SIGHT_ROWS, SIGHT_COLUMNS = 120, 160


def sight_of(report: Any, blobs: list[bytes]) -> Sight:
    """The sight in a message, checked for form and size. Raises KeyError, TypeError, ValueError."""
    (picture,) = blobs
    if len(picture) != SIGHT_ROWS * SIGHT_COLUMNS:
        raise ValueError("no picture")
    return Sight(picture, number(report["steering"]), number(report["speed"]), _or_none(number, report["value"]))


def prints_of(report: Any) -> Prints:
    """The prints in a message, checked for form and size. Raises KeyError, TypeError, ValueError."""
    kept, last = report["kept"], report["last"]
    if not (isinstance(kept, str) and isinstance(last, str)):
        raise ValueError("no text")
    if len(kept) > KEPT_CHARACTERS or len(last) > LAST_CHARACTERS:
        raise ValueError("too much text")
    return Prints(readable(kept), readable(last), report["more"] is True)


def reward_ms_of(report: Any) -> float | None:
    """Milliseconds of a call of the reward function, if they were reported. Raises ValueError."""
    milliseconds = _or_none(number, report.get("reward_ms"))
    if milliseconds is not None and not 0.0 <= milliseconds <= _LONGEST_CALL_MS:
        raise ValueError("no time of a call")
    return milliseconds


def iteration_of(message: Any, blobs: list[bytes], network_limit: int) -> Iteration:
    """The iteration in a message, checked for form and size. ``network_limit``: in bytes.

    Raises KeyError, TypeError, ValueError."""
    report = message["iteration"]
    onnx, simtrace = blobs
    if not 0 < len(onnx) <= network_limit:
        raise ValueError("no network")
    if simtrace and not _is_trace(simtrace):
        raise ValueError("no sim-trace")
    values: IterationReport = {
        "number": whole(report["number"], 1),
        "steps": whole(report["steps"]),
        "seconds": number(report["seconds"]),
        "steps_per_second": number(report["steps_per_second"]),
        "episodes": [_episode(one) for one in report["episodes"][:_EPISODES]],
        "eval_trials": [_episode(one) for one in report["eval_trials"][:_TRIALS]],
        "eval_progress": min(max(number(report["eval_progress"]), 0.0), 100.0),
        "eval_reward": number(report["eval_reward"]),
        "eval_lap_ms": _or_none(whole, report["eval_lap_ms"]),
        "eval_clean_laps": min(whole(report["eval_clean_laps"]), _TRIALS),
        "is_best": report["is_best"] is True,
        "mean_reward": _or_none(number, report["mean_reward"]),
        "mean_progress": _or_none(number, report["mean_progress"]),
        "entropy": _or_none(number, report["entropy"]),
        "policy_loss": _or_none(number, report["policy_loss"]),
        "value_loss": _or_none(number, report["value_loss"]),
    }
    driving = [[number(value) for value in place[:4]] for place in message["driving"][:_PLACES]]
    return Iteration(values, driving, onnx, simtrace)


def _is_trace(packed: bytes) -> bool:
    """Whether these are the bytes of a gzipped sim-trace of an ordinary size: downloads unpack it."""
    if len(packed) > SIMTRACE_PACKED:
        return False
    unpacking = zlib.decompressobj(wbits=31)  # gzip's form
    try:
        csv = unpacking.decompress(packed, SIMTRACE_CSV)
    except zlib.error:
        return False
    return unpacking.eof and not unpacking.unused_data and csv.startswith(_HEADER)


def _episode(report: Any) -> EpisodeReport:
    known: EpisodeReport = {
        "reward": number(report["reward"]),
        "progress": min(max(number(report["progress"]), 0.0), 100.0),
        "status": report["status"] if report["status"] in LABELS.values() else LABELS["in_progress"],
        "steps": whole(report["steps"]),
        "time_ms": whole(report["time_ms"]),
    }
    if "episode" in report:
        known["episode"] = _or_none(whole, report["episode"])
    if "lap_ms" in report:
        known["lap_ms"] = _or_none(whole, report["lap_ms"])
    if "track" in report:
        known["track"] = min(whole(report["track"]), MOST_TRACKS - 1)
        known["direction"] = report["direction"] if report["direction"] in DIRECTIONS else DIRECTIONS[0]
    return known


def number(value: Any) -> float:
    """A finite number of ordinary size. Raises ValueError."""
    if type(value) not in (int, float) or not math.isfinite(value) or abs(value) > GREATEST:
        raise ValueError("not a number")
    return float(value)


def whole(value: Any, least: int = 0) -> int:
    """A whole number within the range of the database. Raises ValueError."""
    if type(value) is not int or not least <= value <= 2**31 - 1:
        raise ValueError("not a whole number")
    return value


Number = TypeVar("Number", int, float)


def _or_none(check: Callable[[Any], Number], value: Any) -> Number | None:
    return None if value is None else check(value)


@dataclass(frozen=True)
class Bounds:
    """In bytes: ``network``, one policy as ONNX; ``state``, a checkpoint or stable-baselines3's file."""

    network: int
    state: int

    @property
    def message(self) -> int:
        """The limit of all blobs of one message: the end of a resumed training has both files."""
        return self.network + max(SIMTRACE_PACKED, self.state)


def bounds_of(spec: TrainerSpec) -> Bounds:
    """The bounds of a training's files. Raises LookupError for a network that no training here has."""
    weights = _FLOAT * NetworkLayout.of(spec.metadata, spec.build).parameters
    return Bounds(weights + _NETWORK_ROOM, int(_TIMES[spec.algorithm] * weights) + _STATE_ROOM)
