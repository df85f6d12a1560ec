"""Trainings for tests: taken on by the real service, run by the real trainer."""

from __future__ import annotations

from typing import Any

from training.hyperparameters import DEFAULT_ACTIONS
from training.models import TrainingJob
from training.services import create_training

REWARD = '''
def reward_function(params):
    """Follow the centre line."""
    width, distance = params["track_width"], params["distance_from_center"]
    for share, reward in ((0.1, 1.0), (0.25, 0.5), (0.5, 0.1)):
        if distance <= share * width:
            return reward
    return 1e-3
'''


def a_training(owner, track, now, **changes: Any) -> TrainingJob:
    """A training on ``track`` with the wizard's defaults."""
    asked = {
        "name": "first",
        "reward_code": REWARD,
        "action_space_type": "discrete",
        "action_space": [dict(action) for action in DEFAULT_ACTIONS],
        "seed": 0,
    }
    return create_training(owner=owner, track=track, now=now, **(asked | changes))
