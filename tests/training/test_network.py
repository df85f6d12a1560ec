"""What the learner sees, and that its network is the same in torch, in ONNX and after the way back."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from evaluation.garage.admission import admit
from paddock.packages.read import UploadPart
from training import house_cars
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS
from training.trainer.network import CONVOLUTIONS, NetworkLayout, from_onnx, to_onnx
from training.trainer.observations import look, senses_of

SENSOR_SETS = (["FRONT_FACING_CAMERA"], ["STEREO_CAMERAS", "LIDAR"], ["observation", "DISCRETIZED_SECTOR_LIDAR"])


def metadata(sensors=("FRONT_FACING_CAMERA",), network="DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", continuous=False) -> dict:
    return {
        "action_space_type": "continuous" if continuous else "discrete",
        "action_space": DEFAULT_BOUNDS if continuous else [dict(action) for action in DEFAULT_ACTIONS],
        "sensor": list(sensors),
        "neural_network": network,
        "training_algorithm": "clipped_ppo",
        "version": "5",
    }


def weights_for(layout: NetworkLayout) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {name: rng.normal(0, 0.1, shape).astype(np.float32) for name, shape in layout.shapes.items()}


def readings_for(layout: NetworkLayout, count: int = 1) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {
        sense.name: rng.integers(0, 256, (count, *sense.spec.shape)).astype(np.uint8)
        if sense.spec.is_picture
        else rng.uniform(0, 1, (count, *sense.spec.shape)).astype(np.float32)
        for sense in layout.senses
    }


def test_a_picture_is_pooled_into_the_means_of_its_blocks():
    (sense,) = senses_of(["STEREO_CAMERAS"])
    frame = np.random.default_rng(0).integers(0, 256, (2, 120, 160, 2)).astype(np.uint8)
    row = look([sense], {"STEREO_CAMERAS": frame})
    means = frame.reshape(2, 30, 4, 40, 4, 2).mean(axis=(2, 4)).transpose(0, 3, 1, 2) / 255.0
    assert row.shape == (2, 2 * 30 * 40)
    np.testing.assert_allclose(row.reshape(2, 2, 30, 40), means, atol=1e-6)


def test_a_white_picture_is_all_ones():
    (sense,) = senses_of(["FRONT_FACING_CAMERA"])
    assert (look([sense], {"FRONT_FACING_CAMERA": np.full((1, 120, 160, 1), 255, np.uint8)}) == 1.0).all()


@pytest.mark.parametrize("sensors", SENSOR_SETS, ids="+".join)
@pytest.mark.parametrize("depth", CONVOLUTIONS)
def test_every_network_comes_back_from_the_gate_unchanged(sensors, depth, tmp_path):
    described = metadata(sensors, depth)
    layout = NetworkLayout.of(described)
    weights = weights_for(layout)
    parts = [
        UploadPart("model.onnx", io.BytesIO(to_onnx(layout, weights, squash=False))),
        UploadPart("model_metadata.json", io.BytesIO(json.dumps(described).encode())),
    ]
    admitted = admit(parts, slots_directory=tmp_path)
    assert admitted.parameters == layout.parameters
    again = from_onnx(layout, admitted.onnx)
    for name, array in weights.items():
        np.testing.assert_allclose(again[name], array, rtol=1e-5, atol=1e-8, err_msg=name)


@pytest.mark.parametrize("sensors", SENSOR_SETS, ids="+".join)
def test_torch_and_onnx_give_the_same_answers(sensors):
    torch = pytest.importorskip("torch", reason="training is not installed: make training")
    from training.trainer.warm_up import make_torso

    layout = NetworkLayout.of(metadata(sensors, continuous=True))
    torso = make_torso(layout)
    head = torch.nn.Linear(128, layout.outputs)
    weights = {"dense": torso.dense.weight, "dense_bias": torso.dense.bias, "head": head.weight, "head_bias": head.bias}
    for sense, eye in zip(layout.senses, torso.eyes, strict=True):
        for number, layer in enumerate(part for part in eye if hasattr(part, "weight")):
            name = f"{sense.name}.conv{number}" if sense.spec.is_picture else f"{sense.name}.dense"
            weights |= {name: layer.weight, f"{name}_bias": layer.bias}
    arrays = {name: tensor.detach().numpy() for name, tensor in weights.items()}
    session = onnxruntime.InferenceSession(to_onnx(layout, arrays, squash=True), providers=["CPUExecutionProvider"])
    readings = readings_for(layout)
    feed = {
        sense.name: (readings[sense.name].transpose(0, 3, 1, 2) if sense.spec.is_picture else readings[sense.name])
        for sense in layout.senses
    }
    (raced,) = session.run(None, {name: array.astype(np.float32) for name, array in feed.items()})
    with torch.no_grad():
        learned = torch.tanh(head(torso(torch.from_numpy(look(list(layout.senses), readings))))).numpy()
    np.testing.assert_allclose(raced, learned, atol=2e-5)


@pytest.mark.parametrize("other", ["DEEP_CONVOLUTIONAL_NETWORK", "DEEP_CONVOLUTIONAL_NETWORK_DEEP"])
def test_a_network_of_another_depth_is_refused(other):
    deep = NetworkLayout.of(metadata(network=other))
    with pytest.raises(ValueError):
        from_onnx(NetworkLayout.of(metadata()), to_onnx(deep, weights_for(deep), squash=False))


def test_a_network_with_non_finite_weights_is_refused():
    layout = NetworkLayout.of(metadata())
    weights = weights_for(layout)
    weights["head"][0, 0] = np.inf
    with pytest.raises(ValueError):
        from_onnx(layout, to_onnx(layout, weights, squash=False))


def test_house_cars_use_the_shallow_network():
    folder = Path(house_cars.__file__).parent
    described = json.loads((folder / "steady.json").read_text())
    described = {"neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", **described}
    weights = from_onnx(NetworkLayout.of(described), (folder / "steady.onnx").read_bytes())
    assert weights["head"].shape[0] == len(described["action_space"])
