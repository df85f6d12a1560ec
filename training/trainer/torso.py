"""The learner's feature extractor; a downloaded stable-baselines3 file carries this class by value."""

from __future__ import annotations

from typing import Any, cast

import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn


class Torso(BaseFeaturesExtractor):
    """Features of a row of numbers (``training.trainer.observations``): convolutions for each picture, a dense layer
    for a lidar, and one dense layer for all. ``contrast``: the mean of pictures and the factor that spreads them, which
    make learning three times as fast (LeCun et al. 1998, Efficient BackProp); None for pictures as they are."""

    contrast: tuple[float, float] | None = None

    def __init__(
        self,
        observation_space: Any,
        senses: Any,
        convolutions: Any,
        lidar_features: int,
        joined: int,
        features: int,
        scale: float = 1.0,
    ) -> None:
        """``senses``: for each sensor (is a picture, start, shape); ``scale``: of a row of bytes; the others as in
        ``network.Layout``."""
        super().__init__(observation_space, features)
        self.scale = float(scale)
        self.senses = [(bool(picture), int(start), tuple(shape)) for picture, start, shape in senses]
        self.eyes = nn.ModuleList()
        for picture, _, shape in self.senses:
            layers: list[nn.Module] = []
            if picture:
                channels = shape[0]
                for filters, size, stride in convolutions:
                    layers += [nn.Conv2d(channels, filters, size, stride=stride), nn.ReLU()]
                    channels = filters
                layers.append(nn.Flatten())
            else:
                layers += [nn.Linear(shape[0], lidar_features), nn.ReLU()]
            self.eyes.append(nn.Sequential(*layers))
        self.dense = nn.Linear(joined, features)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        if self.scale != 1.0:
            observations = observations.float() * self.scale
        seen = []
        for (picture, start, shape), eye in zip(self.senses, self.eyes, strict=True):
            size = shape[0] * shape[1] * shape[2] if picture else shape[0]
            part = observations[:, start : start + size]
            if picture:
                part = part.reshape(-1, *shape)
                if self.contrast is not None:
                    part = (part - self.contrast[0]) * self.contrast[1]
            for layer in cast(nn.Sequential, eye):
                if isinstance(layer, nn.Conv2d) and layer.in_channels > 1:
                    # oneDNN goes back through a convolution with a stride in a third of the time if channels come last
                    part = part.contiguous(memory_format=torch.channels_last)
                part = layer(part)
            seen.append(part)
        joined = seen[0] if len(seen) == 1 else torch.cat(seen, dim=1)
        return torch.relu(self.dense(joined))
