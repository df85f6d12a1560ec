"""Networks that people built in PyTorch and stable-baselines3, written for others and read again."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

from stable_baselines3 import PPO, SAC
from torch import nn

from paddock.packages.kinds import CAR, OPENVINO
from paddock.packages.metadata import parse_metadata
from paddock.packages.tensorflow import convert

from .test_export import CAMERA, openvinos, runtimes, written
from .test_torch_exports import (
    ACTIONS,
    BOX,
    COMMON_LAYERS,
    CONTINUOUS,
    DISCRETE,
    Net,
    Track,
    WholePolicy,
    admit,
    export,
    frames,
)


def check(network: bytes, about: bytes, folder: Path) -> None:
    """OpenVINO answers both forms as the runtime, and the graph is read as the same network."""
    canonical, metadata = admit(network, about), parse_metadata(about)
    feeds = [{CAMERA: frame.transpose(0, 2, 3, 1)} for frame in frames(2)]
    expected = np.concatenate([runtimes(canonical, metadata, feed) for feed in feeds])
    for form in (CAR, OPENVINO):
        path = written(canonical, metadata, form, folder)
        found = np.concatenate(openvinos(path, metadata, feeds))
        np.testing.assert_allclose(found, expected, atol=1e-5, rtol=0)
        if form == CAR:
            assert convert(path.read_bytes(), metadata.inputs) == canonical.onnx


@pytest.mark.soak  # their operators are written one by one in test_export_operators
@pytest.mark.parametrize("middle", COMMON_LAYERS, ids=lambda middle: type(middle).__name__)
def test_common_layers_of_torch_are_written_for_others(middle: nn.Module, tmp_path: Path) -> None:
    check(export(Net(middle).eval()), DISCRETE, tmp_path)


@pytest.mark.parametrize("algorithm", ["ppo", pytest.param("continuous ppo", marks=pytest.mark.soak), "sac"])
def test_policies_of_stable_baselines3_are_written_for_others(algorithm: str, tmp_path: Path) -> None:
    if algorithm == "sac":
        policy = SAC("CnnPolicy", Track(BOX), device="cpu", buffer_size=10).policy.actor
    else:
        space = gymnasium.spaces.Discrete(ACTIONS) if algorithm == "ppo" else BOX
        policy = PPO("CnnPolicy", Track(space), device="cpu", n_steps=8).policy
    outputs = {"output_names": ["actions", "values", "log"]} if algorithm == "ppo" else {}
    network = export(WholePolicy(policy), input_names=["input"], **outputs)
    about = {"ppo": DISCRETE, "continuous ppo": CONTINUOUS}.get(
        algorithm, CONTINUOUS[:-1] + b', "training_algorithm": "sac"}'
    )
    check(network, about, tmp_path)
