"""Gymnasium environments on the very stage that races are judged on. Importing this package registers them."""

from __future__ import annotations

import gymnasium

from .setting import DEFAULT_METADATA, Setting, load_track
from .single import HeadToHeadEnv, ObjectAvoidanceEnv, RacingEnv, TimeTrialEnv

__all__ = [
    "DEFAULT_METADATA",
    "HeadToHeadEnv",
    "ObjectAvoidanceEnv",
    "RacingEnv",
    "Setting",
    "TimeTrialEnv",
    "load_track",
]

_VECTOR = "paddock.simulator.vector"

for _name in ("TimeTrial", "ObjectAvoidance", "HeadToHead"):
    gymnasium.register(
        id=f"Paddock/{_name}-v1",
        entry_point=f"{__name__}:{_name}Env",
        vector_entry_point=f"{_VECTOR}:{_name}VectorEnv",
    )
