"""Compares a stored result with what the same run comes to now."""

import hashlib
import json
from typing import TYPE_CHECKING, Any

from evaluation.models import CompetitorResult, Result
from evaluation.running.results import read_layout

if TYPE_CHECKING:
    from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome


VERSION = "version of "


def differing(result: Result, outcome: "EvaluationOutcome") -> dict[str, tuple[Any, Any]]:
    """The differences by name: the stored value and the measured one. Raises PlatformFault("storage_failed")."""
    pairs: dict[str, tuple[Any, Any]] = {}
    rivals = {rival.number: rival for rival in result.rivals.all()}
    pairs |= _car_pairs("", result, outcome)
    for number, car in enumerate(outcome.rivals, 1):
        pairs |= _car_pairs(f"car {number}: ", rivals[number], car)
    if rivals:
        pairs["order of the cars"] = (result.order, outcome.order)
    layout, driven = read_layout(result), {"boxes": [], "bots": []} | outcome.layout
    pairs["boxes"] = (layout["boxes"], driven["boxes"])
    pairs["bot cars"] = (_digest(layout["bots"]), _digest(driven["bots"]))
    for library in sorted({*result.versions, *outcome.versions}):
        pairs[f"{VERSION}{library}"] = (result.versions.get(library), outcome.versions.get(library))
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _car_pairs(
    prefix: str, stored: CompetitorResult, car: "EvaluationOutcome | CompetitorOutcome"
) -> dict[str, tuple[Any, Any]]:
    return {
        f"{prefix}trace_sha256": (stored.trace_sha256, car.trace_sha256),
        f"{prefix}lap times (ms)": ([lap["time_ms"] for lap in stored.laps], [lap["time_ms"] for lap in car.laps]),
        f"{prefix}reason for ending": (stored.end_reason, car.end_reason),
        f"{prefix}reason for retiring": (stored.retired_code, car.retired["code"] if car.retired else ""),
    }


def _digest(bots: list) -> str:
    """A short name for where all bot cars were at every step; a reader could not compare the poses themselves."""
    return hashlib.sha256(json.dumps(bots, separators=(",", ":")).encode()).hexdigest()[:12] if bots else "none"
