"""Params on a pipe: JSON has no pairs, and the waypoints are the same in every state of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .function import Params

_PAIRS = "objects_location"


def to_wire(states: Sequence[Params]) -> dict[str, Any]:
    """States of one drive (the same waypoints in all) as plain JSON values."""
    return {
        "waypoints": states[0]["waypoints"] if states else [],
        "states": [{key: value for key, value in state.items() if key != "waypoints"} for state in states],
    }


def from_wire(data: dict[str, Any]) -> list[Params]:
    """The inverse of :func:`to_wire`: the same values of the same types."""
    waypoints = [tuple(point) for point in data["waypoints"]]
    return [
        {**state, "waypoints": waypoints, _PAIRS: [tuple(place) for place in state[_PAIRS]]} for state in data["states"]
    ]
