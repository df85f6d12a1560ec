"""Networks as people export them from PyTorch and stable-baselines3 are admitted, and answer as they did there."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import onnx
import onnxruntime
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

import torch
from stable_baselines3 import PPO, SAC
from torch import nn
from torch.nn import functional

from paddock.errors import UserFault
from paddock.packages.admission import admit_network
from paddock.packages.gate import Canonical
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart, read_upload
from tests.hostile.parts import CAMERA, zipped

ACTIONS = 5
DISCRETE = json.dumps(
    {"action_space": [{"steering_angle": angle, "speed": 1.0} for angle in range(ACTIONS)], "sensor": [CAMERA]}
).encode()
CONTINUOUS = json.dumps(
    {
        "action_space_type": "continuous",
        "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 1, "high": 4}},
        "sensor": [CAMERA],
    }
).encode()
FRAME = torch.zeros(1, 1, 120, 160)


def export(module: nn.Module, frame: torch.Tensor = FRAME, **options: object) -> bytes:
    buffer = io.BytesIO()
    torch.onnx.export(module.eval(), (frame,), buffer, **{"opset_version": 17, "dynamo": False, **options})
    return buffer.getvalue()


def admit(network: bytes, metadata: bytes = DISCRETE, weights: dict[str, bytes] | None = None) -> Canonical:
    return admit_network("onnx", network, parse_metadata(metadata), DEFAULT_LIMITS, weights)


def refusal(network: bytes, metadata: bytes = DISCRETE) -> UserFault:
    with pytest.raises(UserFault) as fault:
        admit(network, metadata)
    return fault.value


def frames(count: int = 4) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (count, 1, 1, 120, 160)).astype(np.float32)


def answer(canonical: Canonical, frame: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(canonical.onnx, providers=["CPUExecutionProvider"])
    ((name, dtype, shape),) = canonical.inputs
    return session.run(None, {name: frame.astype(dtype).reshape(shape)})[0][0]


class Net(nn.Module):
    """A small policy; ``middle`` is the layer in question."""

    def __init__(self, middle: nn.Module | Callable | None = None) -> None:
        super().__init__()
        torch.manual_seed(5)
        self.first = nn.Conv2d(1, 8, 8, 8)
        self.middle = middle or nn.Identity()
        self.last = nn.Sequential(nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.LazyLinear(ACTIONS))
        with torch.no_grad():
            self(FRAME)

    def forward(self, frame: torch.Tensor) -> torch.Tensor:
        return self.last(self.middle(torch.relu(self.first(frame / 255.0))))


class WholePolicy(nn.Module):
    """As stable-baselines3's documentation exports one ("Exporting models", after OnnxableSB3Policy)."""

    def __init__(self, policy: nn.Module) -> None:
        super().__init__()
        self.policy = policy

    def forward(self, observation: torch.Tensor) -> tuple[torch.Tensor, ...] | torch.Tensor:
        return self.policy(observation, deterministic=True)


class Track(gymnasium.Env):
    """Only its spaces are needed."""

    observation_space = gymnasium.spaces.Box(0, 255, (1, 120, 160), np.uint8)

    def __init__(self, action_space: gymnasium.Space) -> None:
        self.action_space = action_space

    def reset(self, **_options: object) -> tuple:
        return self.observation_space.sample(), {}


BOX = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


def test_a_discrete_ppo_policy_drives_as_in_stable_baselines3() -> None:
    model = PPO("CnnPolicy", Track(gymnasium.spaces.Discrete(ACTIONS)), device="cpu", n_steps=8)
    canonical = admit(
        export(WholePolicy(model.policy), input_names=["input"], output_names=["actions", "values", "log"])
    )
    assert canonical.taken == "actions"
    assert canonical.inputs[0][0] == CAMERA
    for frame in frames():
        chosen, _ = model.predict(frame[0].astype(np.uint8), deterministic=True)
        assert answer(canonical, frame).argmax() == chosen


def test_a_continuous_ppo_policy_drives_as_in_stable_baselines3() -> None:
    model = PPO("CnnPolicy", Track(BOX), device="cpu", n_steps=8)
    canonical = admit(export(WholePolicy(model.policy), input_names=["input"]), CONTINUOUS)
    for frame in frames():
        chosen, _ = model.predict(frame[0].astype(np.uint8), deterministic=True)
        np.testing.assert_allclose(np.clip(answer(canonical, frame), -1, 1), chosen, atol=1e-5)


def test_a_sac_actor_drives_as_in_stable_baselines3() -> None:
    model = SAC("CnnPolicy", Track(BOX), device="cpu", buffer_size=10)
    canonical = admit(export(WholePolicy(model.policy.actor), input_names=["input"]), CONTINUOUS)
    assert canonical.taken == ""
    for frame in frames():
        chosen, _ = model.predict(frame[0].astype(np.uint8), deterministic=True)
        np.testing.assert_allclose(answer(canonical, frame), chosen, atol=1e-5)


def test_parts_needed_only_by_other_outputs_are_left_out() -> None:
    class ActorCritic(Net):
        def forward(self, frame: torch.Tensor) -> tuple[torch.Tensor, ...]:
            logits = super().forward(frame)
            noise = torch.randn_like(logits)  # an operator that is not allowed
            return noise.sum(1), logits, logits.max(1, keepdim=True).values

    both, plain = export(ActorCritic()), export(Net())
    assert "RandomNormalLike" in {node.op_type for node in onnx.load_from_string(both).graph.node}
    canonical = admit(both)
    assert canonical.taken == onnx.load_from_string(both).graph.output[1].name
    assert canonical.sha256 == admit(plain).sha256


def test_of_two_fitting_outputs_the_known_name_is_taken() -> None:
    class Two(Net):
        def forward(self, frame: torch.Tensor) -> tuple[torch.Tensor, ...]:
            logits = super().forward(frame)
            return logits * 0.5, logits

    assert refusal(export(Two(), output_names=["a", "b"])).code == "onnx_outputs"
    canonical = admit(export(Two(), output_names=["q", "Logits"]))
    assert (canonical.taken, canonical.sha256) == ("Logits", admit(export(Net())).sha256)


def outside(network: bytes, folder: Path) -> tuple[bytes, bytes]:
    """The network and the file of its weights, as torch writes them with ``external_data=True``."""
    model = onnx.load_from_string(network)
    onnx.save_model(model, folder / "car.onnx", save_as_external_data=True, location="car.onnx.data", size_threshold=64)
    return (folder / "car.onnx").read_bytes(), (folder / "car.onnx.data").read_bytes()


def test_external_weights_make_the_same_model_as_inner_ones(tmp_path: Path) -> None:
    whole = export(Net())
    network, data = outside(whole, tmp_path)
    assert len(network) < len(data)
    expected = admit(whole).sha256
    assert admit(network, weights={"car.onnx.data": data}).sha256 == expected
    packed = zipped(("car.onnx", network), ("car.onnx.data", data), ("model_metadata.json", DISCRETE))
    package = read_upload([UploadPart("car.zip", io.BytesIO(packed))])
    assert admit(package.model, package.metadata_json, package.weights).sha256 == expected


def test_missing_weights_are_named(tmp_path: Path) -> None:
    fault = refusal(outside(export(Net()), tmp_path)[0])
    assert fault.code == "onnx_external_missing"
    assert "car.onnx.data" in str(fault) and "external_data=False" in str(fault)


class Function(nn.Module):
    def __init__(self, function: Callable[[torch.Tensor], torch.Tensor]) -> None:
        super().__init__()
        self.function = function

    def forward(self, maps: torch.Tensor) -> torch.Tensor:
        return self.function(maps)


COMMON_LAYERS = [
    nn.Upsample(scale_factor=2, mode="nearest"),
    nn.Upsample(size=(20, 30), mode="bilinear", align_corners=False),
    nn.Upsample(size=(20, 30), mode="bilinear", align_corners=True),
    nn.Upsample(scale_factor=0.5, mode="bicubic"),
    nn.ZeroPad2d(2),
    nn.ReflectionPad2d(2),
    nn.ReplicationPad2d((1, 2, 3, 0)),
    nn.PixelShuffle(2),
    nn.PixelUnshuffle(5),
    Function(lambda maps: functional.normalize(maps, dim=1)),
    Function(lambda maps: functional.interpolate(maps, (9, 9)) + maps.mean((2, 3), keepdim=True).expand(-1, -1, 9, 9)),
    Function(lambda maps: maps - maps.logsumexp(1, keepdim=True)),
    nn.Sequential(nn.Conv2d(8, 8, 3, padding=1, padding_mode="reflect"), nn.SiLU(), nn.BatchNorm2d(8)),
    nn.Sequential(nn.GroupNorm(2, 8), nn.GELU(), nn.Hardswish(), nn.Dropout2d()),
    nn.Sequential(nn.InstanceNorm2d(8, affine=True), nn.LeakyReLU(), nn.AvgPool2d(2), nn.Softsign()),
]


@pytest.mark.parametrize("middle", COMMON_LAYERS, ids=lambda middle: type(middle).__name__)
def test_common_vision_layers_are_admitted_and_agree(middle: nn.Module) -> None:
    net = Net(middle).eval()
    canonical = admit(export(net))
    for frame in frames(2):
        with torch.no_grad():
            expected = net(torch.from_numpy(frame))[0].numpy()
        np.testing.assert_allclose(answer(canonical, frame), expected, atol=1e-4, rtol=1e-4)


class Recurrent(Net):
    def __init__(self) -> None:
        super().__init__()
        self.memory = nn.LSTM(8 * 15 * 20, 16, batch_first=True)
        self.out = nn.Linear(16, ACTIONS)

    def forward(self, frame: torch.Tensor) -> torch.Tensor:
        flat = torch.relu(self.first(frame)).flatten(1)[:, None]
        return self.out(self.memory(flat)[0][:, 0]) if hasattr(self, "out") else super().forward(frame)


@pytest.mark.parametrize(
    ("module", "options", "code", "words"),
    [
        (Recurrent(), {}, "onnx_operator", ["nn.LSTM", "/memory/"]),
        (Net(), {"opset_version": 9}, "onnx_opset", ["opset_version"]),
        (Net(nn.ConvTranspose2d(8, 8, 2)), {}, "onnx_operator", ["nn.ConvTranspose2d", "/middle/"]),
        (
            Net(),
            {"frame": torch.zeros(1, 1, 84, 84)},
            "onnx_input_shape",
            ["[1, 1, 84, 84]", "[1, 1, 120, 160]", "example"],
        ),
        (Net().double(), {"frame": FRAME.double()}, "onnx_tensor_type", ["double"]),
    ],
)
def test_a_refusal_speaks_in_terms_of_torch(module: nn.Module, options: dict, code: str, words: list[str]) -> None:
    fault = refusal(export(module, **options))
    assert fault.code == code
    assert all(word in str(fault) for word in words), str(fault)


def test_a_network_for_other_actions_says_what_to_compare() -> None:
    fault = refusal(export(Net()), CONTINUOUS)
    assert fault.code == "onnx_output"
    assert "[1, 2]" in str(fault) and "forward()" in str(fault) and "action_space" in str(fault)
