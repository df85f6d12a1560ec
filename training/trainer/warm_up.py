"""Loads and compiles everything before the lock, which then allows no file and no executable memory.

oneDNN compiles convolutions for each size of a batch at its first use, so every size of this training is used once
before.
"""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.save_util import save_to_zip_file

from .network import LIDAR_FEATURES, NetworkLayout
from .observations import Sense
from .spec import Warmth
from .torso import Torso


def make_torso(layout: NetworkLayout) -> Torso:
    return Torso(row_space(layout.senses), **torso_arguments(layout))


def row_space(senses: Sequence[Sense], more: int = 0) -> spaces.Box:
    """The space of a row with so many more numbers."""
    if senses[0].pool == 1:
        return spaces.Box(0, 255, (senses[-1].stop,), np.uint8)
    return spaces.Box(-np.inf, np.inf, (senses[-1].stop + more,), np.float32)


def torso_arguments(layout: NetworkLayout) -> dict[str, Any]:
    """The arguments of :class:`.torso.Torso` but for the observation space."""
    return {
        "senses": [(sense.spec.is_picture, sense.start, sense.shape) for sense in layout.senses],
        "convolutions": layout.convolutions,
        "lidar_features": LIDAR_FEATURES,
        "joined": layout.joined,
        "features": layout.features,
        "scale": layout.row_scale,
    }


def warm_up(planned: Warmth) -> None:
    """Run every size of a batch once, forwards, and backwards where the training learns from it; and write and read a
    file of each kind."""
    layout = NetworkLayout.of(planned["metadata"], planned["build"])
    torso = make_torso(layout)
    optimiser = torch.optim.Adam(torso.parameters())
    for size in planned["learned"]:
        optimiser.zero_grad()
        torso(torch.zeros(size, layout.senses[-1].stop)).sum().backward()
        optimiser.step()
    with torch.no_grad():
        for size in {*planned["driven"], *planned["learned"]}:
            torso(torch.zeros(size, layout.senses[-1].stop))
    file = io.BytesIO()
    torch.save({"policy": torso.state_dict(), "optimisers": [optimiser.state_dict()]}, file)
    torch.load(io.BytesIO(file.getvalue()), weights_only=True)
    save_to_zip_file(io.BytesIO(), data={"class": Torso}, params={"policy": torso.state_dict()})
