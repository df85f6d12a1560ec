"""A guide that sees the state of the road learns first, and the car's own policy follows it by pictures."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest

from paddock.simulator.rewards import follow_centre_line
from paddock.simulator.vector import TimeTrialVectorEnv
from tests.paddock.simulator.tracks_for_tests import stadium
from tests.training.specs import a_spec
from tests.training.test_network import metadata
from training.trainer.network import CONSOLE, NetworkLayout, to_onnx
from training.trainer.observations import look
from training.trainer.spec import CARS

pytest.importorskip("torch", reason="training is not installed: make training")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from training.trainer import learners, process
from training.trainer.cars import TrainingCars
from training.trainer.learners import Learner
from training.trainer.mirror_augmentation import Mirror
from training.trainer.road_state import LENGTH, MIRRORED, road_state

pytestmark = pytest.mark.xdist_group("training")

TRACK = stadium(1.5)
SPEC = a_spec(TRACK, hyperparameters={"num_episodes_between_training": 5, "num_epochs": 3})
CONTINUOUS = replace(SPEC, metadata=metadata(continuous=True))
PIXELS = 30 * 40


class Silent(BaseCallback):
    def _on_step(self) -> bool:
        return True


@pytest.fixture
def made():
    """Makes guided learners; the cars of all are closed."""
    cars: list[TrainingCars] = []

    def make(spec=SPEC, guided=True, hurry=lambda: False) -> Learner:
        layout = NetworkLayout.of(spec.metadata)
        cars.append(TrainingCars(spec, TRACK, [follow_centre_line] * CARS, list(layout.senses), 0, guided))
        return Learner(spec, layout, cars[-1], Silent(), hurry, Mirror.of(spec, layout), guided=guided)

    yield make
    for one in cars:
        one.close()


def taught(learner: Learner, updates: int = 2) -> Learner:
    """After so many updates: the guide drives from the second on."""
    for _ in range(updates):
        assert learner.drive()
        learner.update()
    return learner


def same(one: dict, other: dict) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in one)


class TestRoadState:
    def test_on_the_centre_line_of_a_straight_road(self):
        env = TimeTrialVectorEnv(1, track=TRACK, metadata=SPEC.metadata)
        env.reset(seed=0, options={"start_m": 0.1})
        assert road_state(env.car(0))[:6] == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 1.0], abs=1e-6)
        env.reset(options={"start_m": 0.1, "astray": lambda rng: (0.25, np.radians(30.0))})
        offset, sine, cosine, left, *_ = road_state(env.car(0))
        assert 0.5 < offset < 0.7, "of its nose"
        assert (sine, cosine) == pytest.approx((0.5, np.sqrt(0.75)), abs=0.05)
        assert left < -0.5, "the centre line ahead lies to the right"
        env.close()

    def test_the_mirrored_car_has_the_mirrored_state(self):
        """On a track that is its own mirror image, driven the other way round with the wheel turned the other way."""
        states = []
        for direction, steering in (("ccw", 4), ("cw", 0)):
            env = TimeTrialVectorEnv(1, track=TRACK, direction=direction, metadata=SPEC.metadata)
            env.reset(seed=0, options={"start_m": 0.0})
            for action in [2] * 12 + [steering] * 6:
                env.step(np.array([action]))
            states.append(np.array(road_state(env.car(0))))
            env.close()
        assert np.abs(states[0][[0, 1]]).min() > 0.1
        np.testing.assert_allclose(states[0] * MIRRORED, states[1], atol=0.02)

    def test_rows_end_with_it_and_are_turned_round_with_it(self, made):
        learner = made()
        rows = learner.model.env.reset()
        states = [road_state(learner.model.env.env.car(number)) for number in range(CARS)]
        assert rows.shape == (CARS, PIXELS + LENGTH)
        np.testing.assert_allclose(rows[:, PIXELS:], states, rtol=1e-6)
        seen = torch.from_numpy(rows)
        turned = learner._mirror.rows(seen)
        assert torch.equal(turned[:, PIXELS:], seen[:, PIXELS:] * torch.from_numpy(MIRRORED))
        assert torch.equal(turned[:, :PIXELS], learner._mirror.rows(seen[:, :PIXELS]))
        assert made(guided=False).model.env.reset().shape == (CARS, PIXELS)


class TestWhere:
    def test_new_cars_of_ppo_alone_on_the_track(self):
        assert SPEC.guided and CONTINUOUS.guided
        assert not a_spec(TRACK, "sac").guided
        assert not replace(SPEC, race_type="object_avoidance").guided and not replace(SPEC, build=CONSOLE).guided

    @pytest.mark.parametrize("start", ["", "weights"])
    def test_a_clone_goes_alone_from_the_beginning(self, start, made, idle):
        network = to_onnx(NetworkLayout.of(SPEC.metadata), made().weights(), squash=False)
        idle.begin(start, network if start else b"")
        assert (idle._learner._guide is not None) == (start == "")

    @pytest.mark.parametrize("guided", [True, False])
    def test_a_training_that_goes_on_keeps_its_guide(self, guided, idle, made):
        learner = made()
        if not guided:
            learner.go_alone()
        state = {"learner": learner.state(), "number": 1, "updates": 1, "episode": 1, "drills": None, "best": None}
        file = io.BytesIO()
        torch.save(state, file)
        idle.begin("checkpoint", file.getvalue())
        again = idle._learner
        assert again.guided == guided
        assert same(again.weights(), learner.weights()), "pictures are spread as before"
        if guided:
            before, after = learner._guide.state_dict(), again._guide.state_dict()
            assert all(torch.equal(before[name], after[name]) for name in before)

    def test_checkpoints_of_earlier_versions_have_no_guide(self, made, idle):
        learner = made(guided=False)
        state = learner.state()
        del state["guide"], state["contrast"]
        file = io.BytesIO()
        torch.save({"learner": state, "number": 1, "updates": 1, "episode": 1, "drills": None, "best": None}, file)
        idle.begin("checkpoint", file.getvalue())
        assert idle._learner._guide is None and same(idle._learner.weights(), learner.weights())


@pytest.fixture
def idle(tmp_path, monkeypatch):
    """A training before its beginning, whose messages go to a file."""
    monkeypatch.setattr(process.watch, "must_halt", process.watch.must_halt)  # put back afterwards
    with (tmp_path / "in").open("w+b") as told, (tmp_path / "out").open("wb") as said:
        one = process.Training(replace(SPEC, trials=1), told.fileno(), said.fileno())
        yield one
        one._cars.close()
        one._judge.close()


class TestFollowing:
    def test_the_exported_network_is_what_drives_and_sees_pictures_alone(self, made):
        learner = taught(made())
        env = learner.model.env
        readings = {"FRONT_FACING_CAMERA": np.stack([env.env.readings(n)["FRONT_FACING_CAMERA"] for n in range(CARS)])}
        rows = look(list(learner.layout.senses), readings)
        outputs = learner.act(rows)
        assert np.array_equal(outputs, learner.act(np.concatenate([rows, np.ones((CARS, LENGTH), np.float32)], 1)))
        network = to_onnx(learner.layout, learner.weights(), squash=False)
        session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
        pictures = readings["FRONT_FACING_CAMERA"].transpose(0, 3, 1, 2).astype(np.float32)
        raced = [session.run(None, {"FRONT_FACING_CAMERA": one[None]})[0][0] for one in pictures]
        np.testing.assert_allclose(raced, outputs, atol=1e-4)
        assert np.ptp(outputs, axis=0).max() > 0.1, "cars in various places do various things"

    def test_it_takes_over_actions_and_values(self, made, monkeypatch):
        learner = made()
        assert learner.drive()
        rows = torch.from_numpy(learner.model.rollout_buffer.observations.reshape(-1, PIXELS + LENGTH).copy())

        def apart() -> tuple[float, float]:
            """The share of other actions, and the difference of values."""
            with torch.no_grad():
                wanted = learner._guide.get_distribution(rows).distribution.logits.argmax(1)
                values = learner._guide.predict_values(rows) - learner._policy.predict_values(rows)
            chosen = torch.from_numpy(learner.act(rows.numpy())).argmax(1)
            return float((chosen != wanted).float().mean()), float(values.square().mean())

        before = apart()
        monkeypatch.setattr(learners, "_FOLLOWED", 40)
        assert learner._follow()
        after = apart()
        assert after[0] < 0.2 < before[0] and after[1] < 0.5 * before[1]

    def test_steering_and_speed_as_numbers(self, made):
        learner = taught(made(CONTINUOUS))
        guide = learner._guide
        assert torch.equal(learner._policy.log_std, guide.log_std)
        assert not torch.equal(guide.log_std, torch.zeros(2))

    def test_the_latest_updates_are_followed(self, made, monkeypatch):
        learner = made()
        monkeypatch.setattr(learners, "_FOLLOWED", 0)
        assert learner.drive()
        driven = learner.model.rollout_buffer.observations.reshape(-1, PIXELS + LENGTH)
        monkeypatch.setattr(learners, "_SHOWN", 700)
        for known in (512, 700, 700):
            learner._follow()
            assert learner._shown.shape == (known, PIXELS + LENGTH) and np.array_equal(learner._shown[-512:], driven)
        monkeypatch.setattr(learners, "_SHOWN", 100)
        learner._follow()
        assert np.array_equal(learner._shown, driven), "at least what was just driven"

    @pytest.mark.parametrize("updates", [0, 1])
    @pytest.mark.parametrize("hurried_at", [1, 3 * 8 + 2])
    def test_an_interrupted_update_is_undone_in_both(self, made, hurried_at, updates):
        """After the eight batches of three epochs the guide has learned and the car's own policy begins."""
        asked: list[int] = []
        learner = made(hurry=lambda: (asked.append(1), len(asked) == hurried_at)[1])
        if updates:
            asked += [1] * hurried_at
            taught(learner, updates)
            asked.clear()
        assert learner.drive()
        before = [{name: it.clone() for name, it in one.state_dict().items()} for one in learner._policies]
        learner.update()
        after = [one.state_dict() for one in learner._policies]
        assert all(torch.equal(one[name], two[name]) for one, two in zip(before, after, strict=True) for name in one)
        assert len(asked) == hurried_at

    def test_the_same_seed_makes_the_same_weights(self, made):
        found = []
        for _ in range(2):
            learner = taught(made())
            found.append(learner.weights())
        assert same(*found)

    def test_alone_it_learns_by_itself(self, made, monkeypatch):
        learner = taught(made())
        assert learner.guided and len(learner._shown)
        monkeypatch.setattr(learners, "_GUIDED_STEPS", 1)
        taught(learner, 1)
        assert not learner.guided and learner._guide is None and not len(learner._shown)
        before = learner.weights()
        assert learner.drive()
        learner.update()
        assert not same(before, learner.weights())


def test_actions_that_were_next_to_impossible_leave_finite_weights(made):
    """Such are mirror images of what a sharp policy does."""
    learner = made(guided=False)
    assert learner.drive()
    learner.model.rollout_buffer.log_probs[:] = -100.0
    learner.update()
    assert learner.is_finite()


def test_the_file_for_stable_baselines3_is_the_cars_own_policy(made):
    learner = taught(made())
    weights = learner.weights()
    policy = PPO.load(io.BytesIO(learner.to_zip())).policy
    assert policy.observation_space.shape == (PIXELS,)
    assert not any(name.startswith("mlp_extractor.") for name in policy.state_dict())
    assert np.array_equal(policy.features_extractor.eyes[0][0].weight.detach().numpy(), weights[next(iter(weights))])
    assert same(weights, learner.weights())
    rows = np.random.default_rng(0).random((4, PIXELS), np.float32)
    with torch.no_grad():
        loaded = policy.action_net(policy.features_extractor(torch.from_numpy(rows))).numpy()
    np.testing.assert_allclose(loaded, learner.act(rows), atol=1e-5)
