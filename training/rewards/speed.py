"""How fast a reward function is, and what that does to a training. Nothing here imports Django."""

from __future__ import annotations

from collections.abc import Sequence

from paddock.errors import UserFault

SLOW_MS = 5.0  # of a call: from here on it is worth a warning
SLOW_LOAD_MS = 500.0  # of the lines outside of the function, which run once for each car
UPDATE_STEPS = 2_000  # that a training drives between two updates by default: 20 episodes
CARS = 20  # that load it: 16 that gather experience, and those of the evaluations


def slowness(call_ms: Sequence[float], load_ms: float) -> list[UserFault]:
    """Warnings about the milliseconds of processor time that calls took, and loading. The slowest call does not count
    where there are others: a function may prepare something in it."""
    warnings = []
    usual = sorted(call_ms)[: max(1, len(call_ms) - 1)]
    mean = sum(usual) / len(usual) if usual else 0.0
    if mean >= SLOW_MS:
        warnings.append(
            UserFault("reward_slow", ms=round(mean), steps=UPDATE_STEPS, seconds=round(mean * UPDATE_STEPS / 1000.0))
        )
    if load_ms >= SLOW_LOAD_MS:
        params = {"ms": round(load_ms), "count": CARS, "seconds": round(load_ms * CARS / 1000.0)}
        warnings.append(UserFault("reward_slow_start", **params))
    return warnings
