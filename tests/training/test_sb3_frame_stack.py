"""A policy trained over VecFrameStack of stable-baselines3 drives on the site as it does at home."""

from __future__ import annotations

import io
import json
import zipfile
from functools import cache

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecFrameStack

from evaluation.garage import admission as admit_module
from evaluation.garage.admission import AdmittedPackage, admit
from evaluation.running.drives import DriveJob, LapDrive, drive_all
from evaluation.running.pipeline import RaceJob, evaluate
from evaluation.running.race_setup import Venue
from paddock.errors import UserFault
from paddock.geometry.catalogue import by_slug
from paddock.network.bound import NetworkFacts
from paddock.network.session import load
from paddock.packages.metadata import identity
from paddock.packages.own import OwnCar
from paddock.packages.read import UploadPart
from paddock.rules.race import RaceRules
from paddock.rules.report import LAP
from paddock.simulator.action import DISCRETE as LIST
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.envs import DEFAULT_METADATA
from paddock.simulator.envs.sb3 import make_sb3_env
from paddock.simulator.own import drive
from paddock.simulator.retracing import TracePath
from paddock.simulator.sensors import policy_header
from tests.hostile.here import launch_here
from tests.pinned import pinned_process

from .test_sb3_env import Pilot

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("frame stack")]  # they share what has learned

RACE = "Paddock/TimeTrial-v1"
DISCRETE = dict(DEFAULT_METADATA)
CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}},
}
LIMITS = {"max_resets": 3, "max_simulated_ms": 12_000}
FEW = {"n_steps": 8, "batch_size": 8, "n_epochs": 1}
SMALL = {"buffer_size": 40, "learning_starts": 4, "batch_size": 8, "policy_kwargs": {"net_arch": [16]}}

KINDS = {
    "four pictures": (PPO, "CnnPolicy", 4, DISCRETE, FEW),
    "two of pairs and a lidar": (
        PPO,
        "MultiInputPolicy",
        2,
        {**CONTINUOUS, "sensor": ["STEREO_CAMERAS", "LIDAR"]},
        FEW,
    ),
    "three in a dict": (PPO, "MultiInputPolicy", 3, {**DISCRETE, "sensor": ["LEFT_CAMERA"]}, FEW),
    "five flat": (SAC, "MlpPolicy", 5, {**CONTINUOUS, "sensor": ["FRONT_FACING_CAMERA"]}, SMALL),
}


def cars_of(kind: str, **options: object) -> VecFrameStack:
    _, policy, frames, metadata, _ = KINDS[kind]
    observation = "dict" if policy == "MultiInputPolicy" else "box"
    return VecFrameStack(make_sb3_env(RACE, 1, metadata=metadata, observation=observation, **options), frames)


def _features(learned: BaseAlgorithm, seen: object) -> torch.Tensor:
    """What the last layer of the policy reads."""
    policy = learned.policy
    if isinstance(learned, PPO):
        return policy.mlp_extractor.forward_actor(policy.extract_features(seen))
    return policy.actor.latent_pi(policy.actor.extract_features(seen, policy.actor.features_extractor))


@cache
def learner(kind: str) -> BaseAlgorithm:
    """Trained for a few steps; its last layer is then moved so that the answers differ from step to step."""
    algorithm, policy, _, _, more = KINDS[kind]
    learned = algorithm(policy, cars_of(kind, start="random"), seed=3, device="cpu", **more).learn(16)
    with torch.no_grad():
        head = learned.policy.action_net if algorithm is PPO else learned.policy.actor.mu
        cars = cars_of(kind, start="random")
        cars.seed(3)
        cars.action_space.seed(3)
        seen, latent = cars.reset(), []
        for _ in range(30):
            latent.append(_features(learned, learned.policy.obs_to_tensor(seen)[0]))
            seen, *_ = cars.step([cars.action_space.sample()])
        latent = torch.cat(latent)
        scores = latent @ head.weight.T
        head.weight.mul_(0.5 / scores.std(dim=0, keepdim=True).T)
        head.bias.copy_(-(latent @ head.weight.T).mean(dim=0))
    return learned


@cache
def saved(kind: str) -> bytes:
    file = io.BytesIO()
    learner(kind).save(file)
    return file.getvalue()


def upload(zipped: bytes, metadata: dict) -> AdmittedPackage:
    said = json.dumps(metadata).encode()
    return admit([UploadPart("car.zip", io.BytesIO(zipped)), UploadPart("model_metadata.json", io.BytesIO(said))])


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(admit_module, "launch", launch_here)


def steered(pilot: Pilot, metadata: dict) -> int | list[float]:
    """Where the pilot steers, as an action of the car."""
    if metadata["action_space_type"] == "discrete":
        return pilot.action
    return [(pilot.action - 5) / 4, 0.3]


def lap_at_home(zipped: bytes, kind: str, *, piloted: bool) -> tuple[list[dict[str, np.ndarray]], list[np.ndarray]]:
    """A drive in our environment over VecFrameStack: at each step the newest observation and what ``predict`` said.
    ``piloted``: a whole lap, on which it is asked while somebody else steers; else it steers, until it is lost."""
    algorithm, _, frames, metadata, _ = KINDS[kind]
    pilot, learned = Pilot(), algorithm.load(io.BytesIO(zipped), device="cpu")
    cars = cars_of(kind, **({"reward_function": pilot} if piloted else LIMITS))
    (sensor, *_), shown, said, seen, over = metadata["sensor"], [], [], cars.reset(), False
    while not over:
        newest = {
            name: value[0, ..., -(value.shape[-1] // frames) :].copy()
            for name, value in (seen if isinstance(seen, dict) else {sensor: seen}).items()
        }
        actions, _ = learned.predict(seen, deterministic=True)
        shown.append(newest)
        said.append(actions[0])
        seen, _, dones, told = cars.step(np.array([steered(pilot, metadata)]) if piloted else actions)
        over = bool(dones[0])
    assert not piloted or told[0]["end_reason"] == "laps_done"
    return shown, said


@pytest.fixture(scope="module")
def pinned():
    with pinned_process() as process:
        yield process


@pytest.mark.parametrize("kind", KINDS)
def test_its_actions_at_home_are_the_sites(kind, pinned, here):
    _, _, frames, metadata, _ = KINDS[kind]
    admitted = upload(saved(kind), metadata)
    assert admitted.metadata.frame_stack == frames
    assert admitted.sha256 == identity(admitted.onnx, admitted.metadata)
    told, space = admitted.metadata.to_dict(), ActionSpace.from_metadata(metadata)
    shown, said = pinned.submit(lap_at_home, saved(kind), kind, piloted=True).result()
    assert len(shown) > 100
    answers, alone = [], []
    policy = Policy(load(admitted.onnx, admitted.facts), policy_header(told, space))
    for newest in shown:
        answers.append(policy.answer(newest))
        one = Policy(load(admitted.onnx, NetworkFacts(bound=0.0)), policy_header(told, space))
        alone.append(one.answer(newest))
    if space.kind == LIST:
        chosen = [int(np.argmax(answer)) for answer in answers]
        assert chosen == [int(action) for action in said] and len(set(chosen)) > 1
        assert [int(np.argmax(answer)) for answer in alone] != chosen, "what was before does not matter to this policy"
    else:
        np.testing.assert_allclose(np.clip(answers, -1, 1), said, atol=1e-4)
        assert not np.allclose(np.clip(alone, -1, 1), said, atol=1e-3), "what was before does not matter to this policy"


def test_it_drives_on_the_site_as_at_home(pinned):
    """All of it behind the sandbox's walls: the admission, the race, a lap among others, and its repetition at home."""
    kind = "four pictures"
    admitted = upload(saved(kind), KINDS[kind][3])
    metadata, facts = admitted.metadata.to_dict(), admitted.facts.to_dict()
    _, said = pinned.submit(lap_at_home, saved(kind), kind, piloted=False).result()
    track, rules = by_slug("oval").geometry(), RaceRules(laps=1, **LIMITS)
    race = evaluate(RaceJob(track, rules, admitted.onnx, metadata, facts=facts))
    path = TracePath.of(race.trace_csv)
    driven = [path.actions[step][2] for step, asked in enumerate(path.asked) if asked]
    assert driven == [int(action) for action in said] and len(set(driven)) > 1 and len(driven) > 50
    assert len(race.laps) == 1 and race.laps[0]["resets"] >= 1, "it drove on after a crash"
    assert evaluate(RaceJob(track, rules, admitted.onnx, metadata, facts=facts)).trace_sha256 == race.trace_sha256
    own = pinned.submit(drive, track, rules, [OwnCar(admitted.onnx, metadata, facts, admitted.sha256)]).result()
    assert own.result.trace.sha256 == race.trace_sha256
    lap = evaluate(RaceJob(track, LAP, admitted.onnx, metadata, facts=facts))
    venue = Venue(track, "ccw", "official")
    laps = drive_all(DriveJob(admitted.onnx, metadata, facts, (LapDrive(0, venue), LapDrive(1, venue)))).drives
    assert {one.trace_sha256 for one in laps} == {lap.trace_sha256}, "a lap knows nothing of the lap before it"


def test_the_zip_without_a_number_and_with_it_are_one_car(here):
    zipped, metadata = saved("four pictures"), KINDS["four pictures"][3]
    silent, spoken = (upload(zipped, {**metadata, **more}) for more in ({}, {"frame_stack": 4}))
    assert silent.sha256 == spoken.sha256 and silent.metadata == spoken.metadata
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w") as archive:
        archive.writestr("model.onnx", silent.onnx)
        archive.writestr("model_metadata.json", json.dumps(silent.metadata.to_dict()))
    package.seek(0)
    assert admit([UploadPart("again.zip", package)]).sha256 == silent.sha256, "the site's own package is the same car"


def over(frames: int, **options: object) -> bytes:
    """An untrained policy over so many frames."""
    cars = VecFrameStack(make_sb3_env(RACE, 1, **{"observation": "box", **options}), frames)
    file, policy = io.BytesIO(), "CnnPolicy" if options.get("observation") != "dict" else "MultiInputPolicy"
    PPO(policy, cars, device="cpu").save(file)
    return file.getvalue()


@pytest.mark.parametrize(
    ("build", "metadata", "code"),
    [
        (lambda: over(10), DISCRETE, "sb3_frame_stack"),
        (lambda: over(3), DISCRETE, "sb3_channels"),
        (lambda: over(1, observation="rgb"), DISCRETE, "sb3_channels"),
        (lambda: over(2, observation="rgb"), DISCRETE, "sb3_channels"),
        (lambda: saved("four pictures"), {**DISCRETE, "frame_stack": 2}, "sb3_observation"),
        (lambda: saved("four pictures"), {**DISCRETE, "frame_stack": 9}, "metadata_frame_stack"),
        (
            lambda: over(2, observation="dict"),
            {**DISCRETE, "sensor": ["FRONT_FACING_CAMERA", "LIDAR"]},
            "sb3_observation",
        ),
    ],
    ids=["ten frames", "three or colours", "colours", "two of colours", "another number", "nine", "one more sensor"],
)
def test_what_cannot_be_told_or_kept_is_refused(build, metadata, code, here):
    with pytest.raises(UserFault) as fault:
        upload(build(), metadata)
    assert fault.value.code == code and str(fault.value).isprintable()


def test_three_frames_are_taken_where_the_metadata_say_so(here):
    assert upload(over(3), {**DISCRETE, "frame_stack": 3}).metadata.frame_stack == 3
