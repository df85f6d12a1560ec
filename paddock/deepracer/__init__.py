"""``import paddock.deepracer`` registers ``deepracer-v0``, the environment of courses, without containers.

The same arguments, spaces, shapes, infos and ends as the environment of that name, which starts a simulator in a
container for each environment. Here it is the simulator of the races (:mod:`paddock.simulator.envs`). A separate
distribution provides the module names ``deepracer`` and ``deepracer_gym``, so that published notebooks run unchanged.
"""

from __future__ import annotations

from multiprocessing.process import current_process
from typing import Any

from . import needs as needs  # refuses a Python without the physics engine
from .agent_config import ENV_ID
from .export import export, model_metadata

__all__ = ["ENV_ID", "close", "export", "model_metadata", "running", "shutdown_all"]


def _register() -> None:
    from gymnasium.envs.registration import register, registry

    # multiprocessing passes this on to every child, which imports this module to read it
    getattr(current_process(), "_config", {})["paddock.deepracer"] = _register
    if ENV_ID not in registry:
        register(id=ENV_ID, entry_point="paddock.deepracer.env:DeepRacerEnv")


_register()


def running() -> list[str]:
    """The names of the environments of this process that are not closed."""
    from .env import OPEN

    return sorted(env.name for env in OPEN)


def close(env: Any, cache: bool | None = None) -> None:
    """Close an environment, wrapped or not. ``cache`` is accepted for compatibility: nothing is kept, as a new
    environment takes milliseconds."""
    env.unwrapped.close(cache=cache)


def shutdown_all() -> None:
    """Close all environments of this process."""
    from .env import OPEN

    for env in list(OPEN):
        env.close()
