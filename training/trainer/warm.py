"""What must be there before the lock: afterwards no file can be opened and no memory made executable.

Torch's convolutions are compiled for each size of a batch when they first meet it (oneDNN; without it learning takes
half as long again), so every size that this training will have is met once before.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.save_util import save_to_zip_file

from .network import LIDAR_FEATURES, NetworkLayout
from .senses import Sense
from .torso import Torso


def make_torso(layout: NetworkLayout) -> Torso:
    """The learner's eyes for a layout."""
    return Torso(row_space(layout.senses), **torso_arguments(layout))


def row_space(senses: Sequence[Sense]) -> spaces.Box:
    """The rows that a learner is given."""
    if senses[0].pool == 1:
        return spaces.Box(0, 255, (senses[-1].stop,), np.uint8)
    return spaces.Box(-np.inf, np.inf, (senses[-1].stop,), np.float32)


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


def warm_up(planned: Mapping[str, Any]) -> None:
    """Meet every size of a batch once, forwards, and backwards where it will be learned from; and write and read what
    will be written and read. ``planned``: :attr:`.spec.TrainerSpec.warmth`."""
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
