"""What the learner does between two looks at the car."""

from __future__ import annotations

import numpy as np
import pytest

from paddock.geometry.catalogue import by_slug
from tests.training.specs import a_spec
from training.trainer.network import NetworkLayout
from training.trainer.spec import CARS

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = pytest.mark.xdist_group("training")


@pytest.mark.parametrize("hurried", [False, True])
def test_an_interrupted_update_is_undone(hurried):
    from stable_baselines3.common.callbacks import BaseCallback

    from paddock.simulator.rewards import follow_centre_line
    from training.trainer.cars import TrainingCars
    from training.trainer.learners import Learner

    class Silent(BaseCallback):
        def _on_step(self) -> bool:
            return True

    track = by_slug("oval").geometry()
    spec = a_spec(track, hyperparameters={"num_episodes_between_training": 5, "batch_size": 128, "num_epochs": 3})
    layout = NetworkLayout.of(spec.metadata)
    asked: list[int] = []
    cars = TrainingCars(spec, track, [follow_centre_line] * CARS, list(layout.senses), 0)
    learner = Learner(spec, layout, cars, Silent(), lambda: (asked.append(1), hurried and len(asked) == 3)[1])
    assert learner.drive()
    before = learner.weights()
    learner.update()
    after = learner.weights()
    cars.close()
    assert all(np.array_equal(before[name], after[name]) for name in before) == hurried
    assert len(asked) == (3 if hurried else 3 * 4)
