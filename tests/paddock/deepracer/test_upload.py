"""A policy that learned in ``deepracer-v0`` is uploaded, and drives in a race as it did at home."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

import torch
from PIL import Image
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecFrameStack, VecNormalize

from evaluation.garage import admission as admit_module
from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.running.pipeline import RaceJob, evaluate
from paddock.deepracer import export, model_metadata
from paddock.errors import UserFault
from paddock.geometry.catalogue.names import find
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from paddock.simulator.retracing import TracePath
from tests.hostile.here import launch_here
from tests.pinned import pinned_process

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("deepracer upload")]

WORLD = "reInvent2019_wide"
TRACK = {"CHANGE_START_POSITION": "false", "ALTERNATE_DRIVING_DIRECTION": "false"}
CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"high": 20, "low": -20}, "speed": {"high": 2, "low": 1}},
}
LIST = {"action_space": [{"steering_angle": angle, "speed": 1.5} for angle in (20, 8, 0, -8, -20)]}
FEW = {"n_steps": 8, "batch_size": 8, "n_epochs": 1}
SMALL = {"buffer_size": 40, "learning_starts": 4, "batch_size": 8}

# the algorithm, the car, the frames, whether observations are normalised, and how it is uploaded
KINDS = {
    "the default and four frames": (PPO, LIST, 4, False, "zip"),
    "colour": (DQN, LIST | {"sensor": ["FRONT_FACING_CAMERA"]}, 1, False, "zip"),
    "colours of three frames and a lidar": (PPO, LIST | {"sensor": ["FRONT_FACING_CAMERA", "LIDAR"]}, 3, False, "zip"),
    "normalised": (PPO, LIST | {"sensor": ["STEREO_CAMERAS"]}, 2, True, "export"),
    "continuous": (SAC, CONTINUOUS | {"sensor": ["STEREO_CAMERAS", "LIDAR"]}, 1, False, "zip"),
    "colour of an exported DQN": (DQN, LIST | {"sensor": ["FRONT_FACING_CAMERA"]}, 2, False, "export"),
    "continuous in colour": (SAC, CONTINUOUS | {"sensor": ["FRONT_FACING_CAMERA"]}, 2, True, "export"),
}


# one zip and one export are converted behind the walls of the sandbox, where each time torch is loaded anew
WALLED = ("the default and four frames", "normalised")


def cars_of(kind: str) -> VecEnv:
    _, agent, frames, normal, _ = KINDS[kind]
    cars: VecEnv = DummyVecEnv([lambda: gymnasium.make("deepracer-v0", agent_config=agent, track_config=TRACK)])
    if frames > 1:
        cars = VecFrameStack(cars, frames)
    return VecNormalize(cars) if normal else cars


def lively(head: torch.nn.Linear, answers: Callable[[], torch.Tensor]) -> None:
    """Move a last layer so that its answers differ from step to step."""
    with torch.no_grad():
        found = answers()
        mean, spread = found.mean(dim=0), found.std(dim=0)
        head.weight.div_(spread[:, None])
        head.bias.copy_((head.bias - mean) / spread)


def learned(kind: str) -> tuple:
    """A model after a few steps, and its cars."""
    algorithm, _, _, _, _ = KINDS[kind]
    cars = cars_of(kind)
    more = FEW if algorithm is PPO else SMALL | {"policy_kwargs": {"net_arch": [16]}}
    model = algorithm("MultiInputPolicy", cars, seed=3, device="cpu", **more).learn(16)
    policy = model.policy
    head = {PPO: "action_net", DQN: "q_net.q_net.2", SAC: "actor.mu"}[algorithm]
    kept: list[torch.Tensor] = []
    layer = policy.get_submodule(head)
    hook = layer.register_forward_hook(lambda _layer, _seen, answer: kept.append(answer.detach()))

    def answers() -> torch.Tensor:
        cars.seed(3)
        cars.action_space.seed(3)
        seen = cars.reset()
        kept.clear()
        for _ in range(30):
            model.predict(seen, deterministic=True)
            seen, *_ = cars.step([cars.action_space.sample()])
        hook.remove()
        return torch.cat(kept)

    lively(layer, answers)
    if isinstance(cars, VecNormalize):
        cars.training = False
    return model, cars


def at_home(kind: str) -> tuple[bytes, dict, list, list]:
    """What is uploaded, its metadata, and an episode that the model drives: its actions and their commands."""
    model, cars = learned(kind)
    with TemporaryDirectory() as folder:
        path = Path(folder, "car.zip")
        if KINDS[kind][-1] == "zip":
            model.save(path)
        else:
            export(model, path, cars)
        uploaded = path.read_bytes()
    cars.seed(1)
    seen, over, actions, commands = cars.reset(), False, [], []
    while not over:
        action, _ = model.predict(seen, deterministic=True)
        seen, _, (over,), (info,) = cars.step(action)
        actions.append(action[0])
        commands.append((info["reward_params"]["steering_angle"], info["reward_params"]["speed"]))
    return uploaded, model_metadata(cars), actions, commands


@pytest.fixture(scope="module")
def pinned():
    with pinned_process() as process:
        yield process


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(admit_module, "launch", launch_here)


def upload(zipped: bytes, metadata: dict | None = None) -> AdmittedPackage:
    parts = [UploadPart("car.zip", io.BytesIO(zipped))]
    if metadata is not None:
        parts.append(UploadPart("model_metadata.json", io.BytesIO(json.dumps(metadata).encode())))
    return admit(parts)


def raced(admitted: AdmittedPackage) -> list[tuple]:
    """The commands of a race until the first fault, in the sandbox: steering, speed, index."""
    rules = RaceRules(laps=1, max_resets=0, max_simulated_ms=180_000)
    track = find(WORLD).track.geometry()
    race = evaluate(RaceJob(track, rules, admitted.onnx, admitted.metadata.to_dict(), facts=admitted.facts.to_dict()))
    path = TracePath.of(race.trace_csv)
    return [path.actions[step] for step, asked in enumerate(path.asked) if asked]


@pytest.mark.parametrize("kind", KINDS)
def test_it_drives_in_a_race_as_at_home(kind, pinned, monkeypatch):
    if kind not in WALLED:
        monkeypatch.setattr(admit_module, "launch", launch_here)
    uploaded, metadata, actions, commands = pinned.submit(at_home, kind).result()
    admitted = upload(uploaded, metadata if KINDS[kind][-1] == "zip" else None)
    assert admitted.metadata.frame_stack == KINDS[kind][2]
    assert admitted.facts.bound is not None, "every step would take the slow exact way"
    driven = raced(admitted)
    assert len(driven) == len(actions) > 10
    if admitted.metadata.action_space_type == "discrete":
        assert [index for *_, index in driven] == [int(action) for action in actions]
        assert len({int(action) for action in actions}) > 1
    else:
        np.testing.assert_allclose([command[:2] for command in driven], commands, atol=0.011)
        assert np.ptp([steering for steering, _ in commands]) > 5


class Net(torch.nn.Module):
    """A student's own network: it crops the sky, halves the picture and scales it."""

    def __init__(self, channels: int, actions: int) -> None:
        super().__init__()
        self.eyes = torch.nn.Sequential(
            torch.nn.Conv2d(channels, 8, 5, stride=3), torch.nn.ReLU(), torch.nn.Flatten(), torch.nn.Linear(1200, 32)
        )
        self.head = torch.nn.Linear(32, actions)

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        seen = torch.nn.functional.interpolate(seen[:, :, 60:] / 255.0, size=(32, 47), mode="bilinear")
        return self.head(torch.relu(self.eyes(seen)))


class Camera(gymnasium.ObservationWrapper):
    """The picture alone, the last ``frames`` along the channels, as many a course's own wrapper gives it."""

    def __init__(self, env: gymnasium.Env, frames: int) -> None:
        super().__init__(env)
        (self.sensor,) = env.observation_space
        channels, *size = env.observation_space[self.sensor].shape
        self.observation_space = gymnasium.spaces.Box(0, 255, (channels * frames, *size), np.uint8)

    def reset(self, **options):
        self.kept = np.zeros(self.observation_space.shape, np.uint8)
        return super().reset(**options)

    def observation(self, observation):
        newest = observation[self.sensor]
        self.kept = np.concatenate((self.kept[len(newest) :], newest))
        return self.kept


def module_at_home(sensor: str, frames: int) -> tuple[bytes, list[int]]:
    torch.manual_seed(5)
    env = Camera(gymnasium.make("deepracer-v0", agent_config=LIST | {"sensor": [sensor]}, track_config=TRACK), frames)
    net = Net(env.observation_space.shape[0], 5)

    def scores(seen: np.ndarray) -> torch.Tensor:
        with torch.no_grad():
            return net(torch.from_numpy(seen).float()[None])

    seen, _ = env.reset(seed=1)
    found = []
    for number in range(30):
        found.append(scores(seen))
        seen, *_ = env.step(number % 5)
    lively(net.head, lambda: torch.cat(found))
    with TemporaryDirectory() as folder:
        uploaded = export(net, Path(folder, "car.zip"), env, frames=frames).read_bytes()
    seen, _ = env.reset(seed=1)
    over, actions = False, []
    while not over:
        actions.append(int(scores(seen).argmax()))
        seen, _, terminated, truncated, _ = env.step(actions[-1])
        over = terminated or truncated
    return uploaded, actions


@pytest.mark.parametrize(("sensor", "frames"), [("FRONT_FACING_CAMERA", 4), ("STEREO_CAMERAS", 1)])
def test_a_module_of_torch_is_exported_by_one_call(sensor, frames, pinned, here):
    uploaded, actions = pinned.submit(module_at_home, sensor, frames).result()
    admitted = upload(uploaded)
    assert admitted.metadata.frame_stack == frames and admitted.facts.bound is not None
    assert [index for *_, index in raced(admitted)] == actions and len(set(actions)) > 1 and len(actions) > 20


@cache
def saved(kind: str) -> bytes:
    algorithm, file = KINDS[kind][0], io.BytesIO()
    more = {} if algorithm is PPO else SMALL
    algorithm("MultiInputPolicy", cars_of(kind), device="cpu", **more).save(file)
    return file.getvalue()


@pytest.mark.parametrize(
    ("kind", "change", "code"),
    [
        ("colour", {"colour": None}, "sb3_channels"),
        ("colour", {"colour": None, "frame_stack": 2}, "sb3_observation"),
        ("colours of three frames and a lidar", {"colour": None}, "sb3_observation"),
        ("the default and four frames", {"sensor": ["FRONT_FACING_CAMERA", "LIDAR"]}, "sb3_observation"),
        ("normalised", {}, "sb3_observation"),
    ],
)
def test_a_zip_that_does_not_tell_enough_is_refused(kind, change, code, here):
    with pytest.raises(UserFault) as fault:
        upload(saved(kind), model_metadata(cars_of(kind)) | change)
    assert fault.value.code == code


class Grey(gymnasium.ObservationWrapper):
    """The front camera in grey, as Pillow has it: what a race shows."""

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self.observation_space = gymnasium.spaces.Box(0, 255, (1, 120, 160), np.uint8)

    def observation(self, observation):
        picture = observation["FRONT_FACING_CAMERA"].transpose(1, 2, 0)
        return np.asarray(Image.fromarray(np.ascontiguousarray(picture)).convert("L"))[None]


@pytest.mark.parametrize(
    ("wrap", "frames", "told"),
    [
        (lambda env: env, 1, {"colour": True}),
        (lambda env: env, 3, {"colour": True, "frame_stack": 3}),
        (Grey, 1, {}),
        (Grey, 3, {"frame_stack": 3}),
    ],
)
def test_the_metadata_tell_colours_from_frames(wrap, frames, told, here):
    agent = LIST | {"sensor": ["FRONT_FACING_CAMERA"]}
    cars = DummyVecEnv([lambda: wrap(gymnasium.make("deepracer-v0", agent_config=agent))])
    cars = VecFrameStack(cars, frames) if frames > 1 else cars
    metadata, file = model_metadata(cars), io.BytesIO()
    assert {name: metadata[name] for name in ("colour", "frame_stack") if name in metadata} == told
    policy = "CnnPolicy" if wrap is Grey else "MultiInputPolicy"
    PPO(policy, cars, device="cpu", **FEW).save(file)
    assert upload(file.getvalue(), metadata).metadata.frame_stack == frames


def test_an_export_leaves_the_programs_network_as_it_is(tmp_path):
    env = Camera(gymnasium.make("deepracer-v0", agent_config={"sensor": ["STEREO_CAMERAS"]}), 1)
    net = Net(2, 5).train()
    export(net, tmp_path / "car.zip", env)
    assert net.training and net.head.training


def test_a_policy_that_does_not_fit_is_refused_at_home(tmp_path):
    env = gymnasium.make("deepracer-v0", agent_config={"sensor": ["STEREO_CAMERAS"]})
    camera = Camera(env, 1)
    with pytest.raises(ValueError, match=r"answers \[1, 4\]; the action space needs \[1, 5\]"):
        export(Net(2, 4), tmp_path / "car.zip", camera)
    assert not (tmp_path / "car.zip").exists()
    inside = VecFrameStack(VecNormalize(DummyVecEnv([lambda: env])), 2)
    model = PPO("MultiInputPolicy", inside, device="cpu", **FEW)
    with pytest.raises(ValueError, match="VecNormalize goes around VecFrameStack"):
        export(model, tmp_path / "car.zip", inside)
