"""Simulated time: control steps and shares of them, never a wall clock."""

from __future__ import annotations

from .physics import PADDOCK_CAR

STEP_MS = 1000.0 * PADDOCK_CAR.ticks_per_step / PADDOCK_CAR.tick_hz


def milliseconds(steps: float) -> int:
    """Whole milliseconds after ``steps`` control steps (a share of a step counts), rounded to the nearest."""
    return round(steps * STEP_MS)
