"""What a trainer is told, for tests of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from paddock.geometry.track import TrackGeometry
from paddock.rules.hyperparameters import DEFAULTS, PPO, SAC
from tests.training.test_network import metadata
from training.trainer.spec import TrainerSpec


def a_spec(
    track: TrackGeometry, algorithm: str = PPO, hyperparameters: Mapping[str, Any] | None = None, **changes: Any
) -> TrainerSpec:
    """A time trial with the usual hyperparameters but for ``hyperparameters``; SAC with ranges of actions."""
    return TrainerSpec(
        track=track.to_dict(),
        race_type="time_trial",
        metadata=metadata(continuous=algorithm == SAC),
        algorithm=algorithm,
        hyperparameters={**DEFAULTS[algorithm], **(hyperparameters or {})},
        **changes,
    )
