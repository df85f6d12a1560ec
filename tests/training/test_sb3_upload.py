"""A policy of stable-baselines3 is uploaded as it was saved, and drives as it does there."""

from __future__ import annotations

import io
import json
import zipfile
from functools import cache

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

import onnxruntime
import torch
from stable_baselines3 import A2C, DQN, PPO, SAC, TD3
from stable_baselines3.common.callbacks import ConvertCallback

from evaluation.garage import admission as admit_module
from evaluation.garage.admission import AdmittedPackage, admit
from paddock.errors import PaddockError
from paddock.geometry.catalogue import by_slug
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart
from paddock.rules.hyperparameters import DEFAULTS
from paddock.simulator.envs import DEFAULT_METADATA
from paddock.simulator.envs.sb3 import make_sb3_env
from paddock.simulator.rewards import follow_centre_line
from tests.hostile.here import launch_here
from tests.soak import only, some
from training.sb3.facts import read_facts
from training.sb3.rebuild import rebuild
from training.trainer.cars import TrainingCars
from training.trainer.learners import Learner
from training.trainer.network import CONSOLE, OURS, NetworkLayout, to_onnx
from training.trainer.spec import TrainerSpec

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("sb3 upload")]  # they share what has learned

DISCRETE = dict(DEFAULT_METADATA)
CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}},
    "sensor": ["FRONT_FACING_CAMERA"],
}
SMALL = {"buffer_size": 10}
LAYERS = {"policy_kwargs": {"activation_fn": torch.nn.ELU, "net_arch": [32, 16]}}


def car(metadata: dict, *sensors: str) -> dict:
    return {**metadata, "sensor": list(sensors or metadata["sensor"])}


KINDS = {
    "PPO, pictures": (PPO, "CnnPolicy", DISCRETE, {}),
    "PPO, pictures, continuous, other layers": (PPO, "CnnPolicy", CONTINUOUS, LAYERS),
    "PPO, flat": (PPO, "MlpPolicy", DISCRETE, {}),
    "PPO, several sensors, other layers": (PPO, "MultiInputPolicy", car(DISCRETE, "STEREO_CAMERAS", "LIDAR"), LAYERS),
    "PPO, sectors, continuous": (
        *(PPO, "MultiInputPolicy", car(CONTINUOUS, "FRONT_FACING_CAMERA", "SECTOR_LIDAR")),
        {"policy_kwargs": {"normalize_images": True, "share_features_extractor": False}},
    ),
    "SAC, pictures": (SAC, "CnnPolicy", CONTINUOUS, SMALL),
    "SAC, several sensors": (SAC, "MultiInputPolicy", car(CONTINUOUS, "LEFT_CAMERA", "LIDAR"), SMALL),
    "SAC, flat stereo": (SAC, "MlpPolicy", car(CONTINUOUS, "STEREO_CAMERAS"), SMALL),
    "A2C, a dict of one": (A2C, "MultiInputPolicy", DISCRETE, {}),
    "DQN": (DQN, "MlpPolicy", DISCRETE, SMALL),
    "TD3": (TD3, "MlpPolicy", CONTINUOUS, SMALL),
}
ALWAYS = ("PPO, flat", "PPO, several sensors, other layers", "SAC, several sensors")  # the others in `make soak`


@cache
def learner(kind: str):
    """A learner of this kind, whose weights are not those it began with; its cars stand somewhere on the oval."""
    algorithm, policy, metadata, more = KINDS[kind]
    observation = "dict" if policy == "MultiInputPolicy" else "box"
    cars = make_sb3_env("Paddock/TimeTrial-v1", 1, metadata=metadata, observation=observation, start="random")
    return algorithm(policy, cars, seed=1, device="cpu", **more)


@cache
def saved(kind: str) -> bytes:
    """What ``save`` writes."""
    file = io.BytesIO()
    learner(kind).save(file)
    return file.getvalue()


def changed(zipped: bytes, **members: bytes | None) -> bytes:
    """The zip with other members; None leaves one out. ``data`` given as a dict changes its keys."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(zipped)) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            if name.replace(".", "_") not in members:
                new.writestr(name, old.read(name))
        for name, content in members.items():
            if content is not None:
                new.writestr(name.replace("_pth", ".pth").replace("_json", ".json"), content)
    return file.getvalue()


def with_data(zipped: bytes, **changes: object) -> bytes:
    """The zip whose ``data`` says something else."""
    with zipfile.ZipFile(io.BytesIO(zipped)) as archive:
        return changed(zipped, data=json.dumps({**json.loads(archive.read("data")), **changes}).encode())


def upload(zipped: bytes, metadata: dict | None) -> AdmittedPackage:
    parts = [UploadPart("car.zip", io.BytesIO(zipped))]
    if metadata is not None:
        parts.append(UploadPart("model_metadata.json", io.BytesIO(json.dumps(metadata).encode())))
    return admit(parts)


def refused(zipped: bytes, metadata: dict | None) -> PaddockError:
    with pytest.raises(PaddockError) as fault:
        upload(zipped, metadata)
    return fault.value


def rebuilt(zipped: bytes, metadata: dict) -> bytes:
    """The network, rebuilt in this process."""
    with zipfile.ZipFile(io.BytesIO(zipped)) as archive:
        tensors = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
        facts = read_facts(archive.read("data"))
    shapes = {name: tuple(tensor.shape) for name, tensor in tensors.items()}
    return rebuild(shapes, lambda name: tensors[name].numpy(), facts, parse_metadata(json.dumps(metadata).encode()))


def own_answer(kind: str, seen) -> np.ndarray:
    """What the learner's policy answers: scores, values of actions, or an action."""
    policy = learner(kind).policy
    with torch.no_grad():
        observation = policy.obs_to_tensor(seen)[0]
        if hasattr(policy, "action_net"):
            features = policy.extract_features(observation, policy.pi_features_extractor)
            features = features[0] if isinstance(features, tuple) else features  # of policy and value, not shared
            return policy.action_net(policy.mlp_extractor.forward_actor(features)).numpy()
        if hasattr(policy, "q_net"):
            return policy.q_net(observation).numpy()
        return policy._predict(observation, deterministic=True).numpy()


@pytest.mark.parametrize(
    "kind", only(("PPO, flat", "PPO, several sensors, other layers", "SAC, several sensors"), KINDS)
)
def test_the_racing_network_answers_as_the_learner(kind):
    metadata = KINDS[kind][2]
    network = onnxruntime.InferenceSession(rebuilt(saved(kind), metadata))
    cars = learner(kind).get_env()
    seen = cars.reset()
    for _ in range(6):
        feed = {}
        for port in network.get_inputs():
            reading = seen[port.name] if isinstance(seen, dict) else seen
            feed[port.name] = reading.reshape(port.shape).astype(np.float32)
        (answer,) = network.run(None, feed)
        np.testing.assert_allclose(answer, own_answer(kind, seen), atol=1e-5)
        predicted, _ = learner(kind).predict(seen, deterministic=True)
        drives = answer.argmax(axis=1) if metadata["action_space_type"] == "discrete" else answer.clip(-1.0, 1.0)
        np.testing.assert_allclose(drives, predicted, atol=1e-5)
        seen, *_ = cars.step(predicted)


@pytest.mark.parametrize("kind", some(["PPO, pictures", "SAC, several sensors"]))
def test_it_is_admitted_in_the_sandbox_and_never_read_outside(kind, monkeypatch):
    monkeypatch.setattr(torch, "load", None)
    metadata = KINDS[kind][2]
    admitted = upload(saved(kind), metadata)
    assert admitted.source_kind == "sb3"
    assert admitted.metadata.to_dict()["sensor"] == metadata["sensor"]
    assert "policy.optimizer.pth" in admitted.ignored or "actor.optimizer.pth" in admitted.ignored
    inside = upload(changed(saved(kind), model_metadata_json=json.dumps(metadata).encode()), None)
    assert inside.sha256 == admitted.sha256, "the metadata may lie in the zip"


@pytest.mark.parametrize(
    ("build", "code"),
    [
        (lambda: (saved("PPO, flat"), None), "sb3_metadata_missing"),
        (lambda: (saved("PPO, flat"), CONTINUOUS), "sb3_actions"),
        (lambda: (saved("PPO, flat"), car(DISCRETE, "STEREO_CAMERAS")), "sb3_observation"),
        (lambda: (saved("PPO, flat"), car(DISCRETE, "FRONT_FACING_CAMERA", "LIDAR")), "sb3_observation"),
        (lambda: (other_extractor(), DISCRETE), "sb3_custom"),
        (lambda: (with_data(saved("PPO, flat"), use_sde=True), DISCRETE), "sb3_custom"),
    ],
    ids=["no metadata", "other actions", "other camera", "one more sensor", "own extractor", "sde"],
)
def test_a_policy_that_would_drive_differently_is_refused(build, code, monkeypatch):
    monkeypatch.setattr(admit_module, "launch", launch_here)
    zipped, metadata = build()
    fault = refused(zipped, metadata)
    assert (fault.code, fault.fault) == (code, "user")
    assert str(fault).isprintable()


def other_extractor() -> bytes:
    said = {":type:": "<class 'dict'>", ":serialized:": "", "features_extractor_class": "<class '__main__.Eyes'>"}
    return with_data(saved("PPO, flat"), policy_kwargs=said)


@pytest.mark.parametrize(
    ("algorithm", "changes", "build"),
    [
        ("ppo", {}, OURS),
        ("ppo", {"sensor": ["LEFT_CAMERA", "LIDAR"], "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_DEEP"}, OURS),
        ("ppo", {}, CONSOLE),
        ("sac", {**CONTINUOUS, "sensor": ["STEREO_CAMERAS", "SECTOR_LIDAR"]}, OURS),
    ],
    ids=["PPO", "PPO, deep, lidar", "the console's network", "SAC, stereo, sectors"],
)
def test_a_trainings_download_holds_its_very_network(algorithm, changes, build):
    learned = ours(algorithm, changes, build)
    said = learned.spec.metadata
    assert rebuilt(learned.to_zip(), said) == to_onnx(learned.layout, learned.weights(), algorithm == "sac")
    with zipfile.ZipFile(io.BytesIO(learned.to_zip())) as archive:
        assert json.loads(archive.read("model_metadata.json")) == said
    kind = PPO if algorithm == "ppo" else SAC
    assert kind.load(io.BytesIO(learned.to_zip()), device="cpu").policy is not None, "its own library still reads it"


def ours(algorithm: str, changes: dict, build: str) -> Learner:
    """A learner of this site's trainings."""
    track = by_slug("oval").geometry()
    spec = TrainerSpec(
        track=track.to_dict(),
        race_type="time_trial",
        metadata=parse_metadata(json.dumps({**DISCRETE, **changes}).encode()).to_dict(),
        algorithm=algorithm,
        hyperparameters=DEFAULTS[algorithm],
        build=build,
    )
    layout = NetworkLayout.of(spec.metadata, build)
    cars = TrainingCars(spec, track, [follow_centre_line] * 2, list(layout.senses), 0)
    return Learner(spec, layout, cars, ConvertCallback(None))


def test_an_unexpected_layer_is_named(monkeypatch):
    monkeypatch.setattr(admit_module, "launch", launch_here)
    with zipfile.ZipFile(io.BytesIO(saved("PPO, flat"))) as archive:
        tensors = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
    file = io.BytesIO()
    torch.save({**tensors, "lstm_actor.weight_ih_l0": torch.zeros(4, 4)}, file)
    fault = refused(changed(saved("PPO, flat"), policy_pth=file.getvalue()), DISCRETE)
    assert fault.code == "sb3_layer" and "lstm_actor.weight_ih_l0" in str(fault)


def test_a_site_without_torch_says_so(monkeypatch):
    monkeypatch.setattr(admit_module, "PROCESSES", {})
    fault = refused(saved("PPO, flat"), DISCRETE)
    assert (fault.code, fault.fault) == ("sb3_needs_torch", "platform")


def test_a_pickle_in_data_is_never_opened():
    """Its other words are read all the same."""
    said = {":type:": "<class 'dict'>", ":serialized:": "Y3Bvc2l4CnN5c3RlbQooUyd0b3VjaCBQV05FRCcKdFIu"}
    assert upload(with_data(saved("PPO, flat"), policy_kwargs=said), DISCRETE).source_kind == "sb3"
