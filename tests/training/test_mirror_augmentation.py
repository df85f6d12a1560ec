"""Half of what is learned from is turned round, where the mirrored car would have earned the same."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from paddock.rules.hyperparameters import DEFAULTS, PPO, SAC
from paddock.simulator.rewards import follow_centre_line
from paddock.simulator.vector import TimeTrialVectorEnv
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.training.specs import a_spec
from tests.training.test_network import metadata
from training.rewards.examples import EXAMPLES
from training.rewards.sandbox.call_limits import watch
from training.rewards.sandbox.function import load_rewards
from training.trainer.mirror_augmentation import Mirror, Twin
from training.trainer.network import NetworkLayout
from training.trainer.observations import look
from training.trainer.spec import CARS, TrainerSpec

torch = pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = pytest.mark.xdist_group("training")

TRACK = stadium(1.5)
SPEC = a_spec(TRACK, hyperparameters={"num_episodes_between_training": 5, "num_epochs": 3})
RIGHT, AHEAD, LEFT = 0, 2, 4  # of the default actions


def mirror_of(**changes) -> Mirror | None:
    spec = replace(SPEC, metadata={**SPEC.metadata, **changes})
    return Mirror.of(spec, NetworkLayout.of(spec.metadata))


class TestWhere:
    def test_actions_that_have_their_opposites(self):
        mirror = mirror_of()
        assert mirror is not None and mirror.holds
        assert mirror.actions(torch.tensor([[0.0], [1.0], [2.0], [4.0]])).flatten().tolist() == [4, 3, 2, 0]
        assert mirror.actions(torch.tensor([0, 1, 2])).tolist() == [4, 3, 2]

    def test_steering_as_a_number(self):
        bounds = {"steering_angle": {"low": -20.0, "high": 20.0}, "speed": {"low": 0.5, "high": 2.0}}
        mirror = mirror_of(action_space_type="continuous", action_space=bounds)
        assert mirror.actions(torch.tensor([[0.5, -0.25]])).tolist() == [[-0.5, -0.25]]
        bounds["steering_angle"]["low"] = -10.0
        assert mirror_of(action_space_type="continuous", action_space=bounds) is None

    @pytest.mark.parametrize(
        "actions",
        [
            [{"steering_angle": -30.0, "speed": 1.0}, {"steering_angle": 20.0, "speed": 1.0}],
            [{"steering_angle": -30.0, "speed": 1.0}, {"steering_angle": 30.0, "speed": 2.0}],
            [{"steering_angle": 0.0, "speed": 1.0}, {"steering_angle": 0.0, "speed": 1.0}],
        ],
        ids=["other angle", "other speed", "twice the same"],
    )
    def test_no_opposites(self, actions):
        assert mirror_of(action_space=actions) is None

    @pytest.mark.parametrize("sensors", [["LEFT_CAMERA"], ["STEREO_CAMERAS"], ["FRONT_FACING_CAMERA", "LIDAR"]])
    def test_other_sensors(self, sensors):
        assert mirror_of(sensor=sensors) is None


def test_the_mirrored_car_sees_the_mirrored_picture():
    """On a track that is its own mirror image, driven the other way round with the wheel turned the other way."""
    seen, senses = [], list(NetworkLayout.of(SPEC.metadata).senses)
    for direction, steering in (("ccw", LEFT), ("cw", RIGHT)):
        env = TimeTrialVectorEnv(1, track=TRACK, direction=direction, metadata=SPEC.metadata)
        readings, _ = env.reset(seed=0, options={"start_m": 0.0})
        pictures = [look(senses, readings)]
        for action in [AHEAD] * 12 + [steering] * 6:
            readings, *_ = env.step(np.array([action]))
            pictures.append(look(senses, readings))
        seen.append(torch.from_numpy(np.concatenate(pictures)))
        env.close()
    turned = mirror_of().rows(seen[0])
    assert float((turned - seen[1]).abs().mean()) < 0.01 < 3 * float((seen[0] - seen[1]).abs().mean())
    assert torch.equal(mirror_of().rows(turned), seen[0])


def holds(code: str, actions: list[int] | None = None) -> bool:
    """Whether the mirror is still believed in after some driving with this reward function."""
    mirror = mirror_of()
    one, other = load_rewards(code, 2)
    env = TimeTrialVectorEnv(
        1, track=TRACK, metadata=SPEC.metadata, reward_function=Twin(one, other, mirror), start="random"
    )
    env.reset(seed=5)
    for action in actions or np.random.default_rng(2).integers(0, 5, 40):
        env.step(np.array([action]))
    env.close()
    return mirror.holds


def test_sac_learns_from_what_was_driven_alone():
    spec = replace(SPEC, algorithm=SAC, hyperparameters=dict(DEFAULTS[SAC]), metadata=metadata(continuous=True))
    assert Mirror.of(spec, NetworkLayout.of(spec.metadata)) is None
    assert Mirror.of(replace(spec, algorithm=PPO), NetworkLayout.of(spec.metadata)) is not None


class TestRewards:
    @pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.slug)
    def test_every_example_pays_both_sides_alike(self, example):
        assert holds(example.code)

    @pytest.mark.parametrize(
        "code",
        [
            "def reward_function(params):\n    return 1.0 if params['is_left_of_center'] else 0.5",
            "def reward_function(params):\n    return 0.5 if params['steering_angle'] > 10 else 1.0",
            "PLACES = [(1.0, 2.0)]\ndef reward_function(params):\n    return abs(params['y'] - PLACES[0][1])",
            "import random\ndef reward_function(params):\n    return random.random()",
            "n = 0\ndef reward_function(params):\n    global n\n    n += 1\n    return n if params['y'] > 0 else -n",
        ],
        ids=["a lane", "a side", "a table of places", "chance", "what it remembers"],
    )
    def test_what_tells_the_sides_apart_is_found_out(self, code):
        assert not holds(code)

    def test_a_fault_for_the_mirrored_car_alone_is_a_difference_and_ends_nothing(self):
        code = "def reward_function(params):\n    assert params['steering_angle'] >= 0\n    return 1.0"
        assert holds(code, [AHEAD] * 3)
        assert not holds(code, [LEFT] * 3)

    def test_what_the_function_prints_is_printed_once(self):
        one, other = load_rewards("def reward_function(params):\n    print('paid')\n    return 1.0", 2)
        mirror, before = mirror_of(), watch.printed
        params = {
            **{"y": 1.0, "heading": 90.0, "steering_angle": 30.0, "is_left_of_center": True},
            **{"distance_from_center": 0.1, "waypoints": [(0.0, 1.0)]},
            **{"objects_location": [(1.0, 2.0)], "objects_left_of_center": [False], "objects_heading": [0.5]},
        }
        with contextlib.redirect_stdout(watch):
            assert Twin(one, other, mirror)(params) == 1.0
        assert watch.printed[len(before) :] == "paid\n" and not watch.muted

    def test_objects_stand_on_the_other_side(self):
        told = []
        params = {
            **{"y": 1.0, "heading": 90.0, "steering_angle": 30.0, "is_left_of_center": True},
            **{"distance_from_center": 0.1, "waypoints": [(0.0, 1.0)], "x": 3.0},
            **{"objects_location": [(1.0, 2.0)], "objects_left_of_center": [False], "objects_heading": [0.5]},
        }
        twin = Twin(lambda _: 1.0, lambda params: told.append(params) or 1.0, mirror_of())
        assert twin(params) == 1.0
        assert told == [
            {
                **{"y": -1.0, "heading": -90.0, "steering_angle": -30.0, "is_left_of_center": False},
                **{"distance_from_center": 0.1, "waypoints": [(0.0, -1.0)], "x": 3.0},
                **{"objects_location": [(1.0, -2.0)], "objects_left_of_center": [True], "objects_heading": [-0.5]},
            }
        ]


@pytest.fixture
def learner():
    from stable_baselines3.common.callbacks import BaseCallback

    from training.trainer.cars import TrainingCars
    from training.trainer.learners import Learner

    class Silent(BaseCallback):
        def _on_step(self) -> bool:
            return True

    made = []

    def make(spec: TrainerSpec = SPEC):
        layout = NetworkLayout.of(spec.metadata)
        cars = TrainingCars(spec, TRACK, [follow_centre_line] * CARS, list(layout.senses), 0)
        made.append(cars)
        return Learner(spec, layout, cars, Silent(), mirror=Mirror.of(spec, layout))

    yield make
    for cars in made:
        cars.close()


class TestLearned:
    def test_half_of_a_batch_of_ppo_is_turned_round(self, learner):
        one = learner()
        assert one.drive()
        buffer, mirror, policy = one.model.rollout_buffer, one._mirror, one.model.policy
        batches = list(one._mirrored_batches()())
        rows = {row.tobytes(): number for number, row in enumerate(buffer.observations)}
        turned, met = 0, []
        for batch in batches:
            with torch.no_grad():
                _, log_prob, _ = policy.evaluate_actions(batch.observations, batch.actions.long().flatten())
            assert torch.allclose(log_prob, batch.old_log_prob, atol=1e-5), "as likely as for the policy that drove"
            for row, action, paid in zip(batch.observations, batch.actions, batch.returns, strict=True):
                number = rows.get(row.numpy().tobytes())
                if number is None:
                    turned += 1
                    number, action = rows[mirror.rows(row[None])[0].numpy().tobytes()], mirror.actions(action)
                met.append(number)
                assert action.item() == buffer.actions[number].item() and paid.item() == buffer.returns[number].item()
        assert len(met) == len(buffer.observations) and len(set(met)) > 0.9 * len(met)
        assert 0.4 < turned / len(met) < 0.6

    def test_nothing_is_turned_round_once_the_mirror_is_not_true(self, learner):
        one = learner()
        assert one.drive() and one._turns
        one._mirror.holds = False
        assert not one._turns
        one.update()
