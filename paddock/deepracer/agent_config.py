"""Reads ``agent_config``: the action space and the sensors of the car."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from paddock.errors import UserFault
from paddock.packages.metadata import parse_metadata

ENV_ID = "deepracer-v0"
FRONT, STEREO, LIDAR = "FRONT_FACING_CAMERA", "STEREO_CAMERAS", "LIDAR"
CAMERAS = (FRONT, STEREO)

DEFAULT: Mapping[str, Any] = {
    "action_space_type": "discrete",
    "action_space": [{"steering_angle": angle, "speed": 0.6} for angle in (30, 15, 0, -15, -30)],
    "sensor": [STEREO, LIDAR],
}
SPACES: Mapping[str, spaces.Box] = {
    FRONT: spaces.Box(0, 255, (3, 120, 160), np.uint8),
    STEREO: spaces.Box(0, 255, (2, 120, 160), np.uint8),
    LIDAR: spaces.Box(0.15, float("inf"), (64,), np.float32),
}

AgentConfig = Mapping[str, Any] | str | os.PathLike[str]


def read_agent_config(config: AgentConfig | None) -> dict[str, Any]:
    """The metadata of the car: ``config``, a dict or the path of a JSON file, over the defaults. Raises TypeError,
    ValueError with the name of the key."""
    if isinstance(config, str | os.PathLike):
        config = json.loads(Path(config).read_text(encoding="utf-8"))
    if config is not None and not isinstance(config, Mapping):
        raise TypeError(f"agent_config must be a dict, the path of a JSON file or None, not {type(config).__name__}")
    metadata = {**DEFAULT, **(config or {})}
    if config and "action_space_type" not in config:
        metadata["action_space_type"] = "discrete" if isinstance(metadata["action_space"], list) else "continuous"
    _check_sensors(metadata["sensor"])
    try:
        parse_metadata(json.dumps(metadata).encode())
    except (TypeError, UserFault) as error:
        raise ValueError(f"agent_config: {error}") from error
    return metadata


def observation_space(sensors: Sequence[str]) -> spaces.Dict:
    """Pictures with the channels first, as they come from the original."""
    return spaces.Dict(dict((name, SPACES[name]) for name in sensors))


def _check_sensors(sensors: Any) -> None:
    if not isinstance(sensors, list | tuple) or not sensors:
        raise ValueError(f"agent_config['sensor'] must be a list of names, not {sensors!r}")
    if unknown := [name for name in sensors if name not in SPACES]:
        raise ValueError(f"agent_config['sensor']: {unknown[0]!r} is not offered; there are {', '.join(SPACES)}")
    cameras = [name for name in sensors if name in CAMERAS]
    if len(cameras) != 1 or len(set(sensors)) != len(sensors):
        raise ValueError(
            f"agent_config['sensor'] needs one camera, {FRONT} or {STEREO}, and {LIDAR} beside it or not; it has "
            f"{', '.join(sensors)}"
        )
