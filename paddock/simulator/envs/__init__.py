"""Gymnasium environments on the stage of the races, registered on import."""

from paddock.plugin import register_envs

from .configuration import DEFAULT_METADATA, default_config
from .setting import Setting, load_track
from .single import HeadToHeadEnv, ObjectAvoidanceEnv, RacingEnv, TimeTrialEnv

__all__ = [
    "DEFAULT_METADATA",
    "HeadToHeadEnv",
    "ObjectAvoidanceEnv",
    "RacingEnv",
    "Setting",
    "TimeTrialEnv",
    "default_config",
    "load_track",
]

register_envs()
