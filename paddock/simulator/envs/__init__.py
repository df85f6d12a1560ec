"""Gymnasium environments on the very stage that races are judged on. Importing this package registers them."""

from __future__ import annotations

from paddock.plugin import register_envs

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

register_envs()
