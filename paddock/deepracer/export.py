"""Writes a policy that was trained in ``deepracer-v0`` as a car for the site: ONNX and ``model_metadata.json``.

PyTorch is imported by the functions alone: the module itself needs none.
"""

from __future__ import annotations

import copy
import io
import json
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from paddock.simulator.camera.colours import colours

from .agent_config import FRONT, SPACES

if TYPE_CHECKING:
    import torch

_OPSET = 17


def model_metadata(env: Any, frames: int | None = None) -> dict[str, Any]:
    """The ``model_metadata.json`` of an environment, wrapped or not, single or many, for the zip of
    stable-baselines3's ``model.save()``. ``frames``: how many observations a wrapper joins, by default those of
    ``VecFrameStack``."""
    metadata = dict(_agent_config(env))
    frames = frames or _frames_of(env)
    space = _space_of(env)
    seen = space[FRONT] if FRONT in getattr(space, "spaces", ()) else space
    if FRONT in metadata["sensor"] and seen.shape[0] == SPACES[FRONT].shape[0] * frames:
        metadata["colour"] = True  # a wrapper may have made it grey, which is what a race shows
    return metadata | ({"frame_stack": frames} if frames > 1 else {})


def export(policy: Any, path: str | Path, env: Any, *, frames: int = 1) -> Path:
    """Write ``policy`` as a zip that the site takes, and return its path.

    ``policy`` is a ``torch.nn.Module`` whose ``forward`` takes a batch of one observation of ``env``, float32 with
    pictures from 0 to 255 and channels first: a dict by sensor, or a tensor where a wrapper made it one. With
    ``frames`` the last observations are joined along the channels, the newest last, as by ``VecFrameStack``. It returns
    a score for each action, or steering and speed in [-1, 1]; cropping, scaling and division belong into it.

    A model of stable-baselines3 does as well, with the means of ``VecNormalize`` around ``VecFrameStack``; ``frames``
    is then known. Raises ValueError for a policy that does not fit ``env``.
    """
    import torch

    sensors = sorted(_agent_config(env)["sensor"])
    boxes = {name: SPACES[name].shape for name in sensors}
    if hasattr(policy, "policy") and hasattr(policy, "observation_space"):
        policy, frames = _of_stable_baselines3(policy, boxes)
    shapes = {name: _race_shape(name, boxes[name], frames) for name in sensors}
    car = _car(policy, sensors, frames, in_a_dict=hasattr(_space_of(env), "spaces")).eval().cpu()
    # bytes where they are looked up in the table of colours
    example = tuple(
        torch.zeros(shapes[name], dtype=torch.uint8 if name == FRONT else torch.float32) for name in sensors
    )
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the trace of a fixed shape is what is wanted
        answer = car(*example)
        found = io.BytesIO()
        torch.onnx.export(
            car,
            example,
            cast(Any, found),
            input_names=sensors,
            output_names=["actions"],
            opset_version=_OPSET,
            dynamo=False,
        )
    metadata = model_metadata(env, frames)
    metadata.pop("colour", None)  # the network colours by itself
    actions = metadata["action_space"]
    expected = len(actions) if isinstance(actions, list) else 2
    if tuple(answer.shape) != (1, expected):
        raise ValueError(f"the policy answers {list(answer.shape)}; the action space needs [1, {expected}]")
    path = Path(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("car.onnx", found.getvalue())
        archive.writestr("model_metadata.json", json.dumps(metadata, indent=2))
    return path


def _agent_config(env: Any) -> Mapping[str, Any]:
    if hasattr(env, "get_attr"):  # many environments, of Gymnasium or of stable-baselines3
        return env.get_attr("agent_config")[0]
    return env.unwrapped.agent_config


def _space_of(env: Any) -> Any:
    """The space of one observation."""
    return getattr(env, "single_observation_space", env.observation_space)


def _frames_of(env: Any) -> int:
    """The number of observations that ``VecFrameStack`` joins round these environments."""
    while env is not None:
        if hasattr(env, "stacked_obs"):
            return env.stacked_obs.n_stack
        env = getattr(env, "venv", None)
    return 1


def _race_shape(name: str, shape: tuple[int, ...], frames: int) -> tuple[int, ...]:
    """The shape of a batch in a race, whose front camera is grey."""
    channels = 1 if name == FRONT else shape[0]
    return (1, channels * frames, *shape[1:])


def _car(policy: torch.nn.Module, sensors: list[str], frames: int, *, in_a_dict: bool) -> torch.nn.Module:
    """``policy`` behind what a race shows: the inputs in the order of ``sensors``, the front camera grey."""
    import torch

    class Car(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.policy = copy.deepcopy(policy)  # the program's own stays on its device and in its mode
            self.colours = torch.nn.Buffer(torch.from_numpy(colours().astype(np.float32)))

        def forward(self, *readings: torch.Tensor) -> torch.Tensor:
            seen = {name: self.look(name, reading) for name, reading in zip(sensors, readings, strict=True)}
            return self.policy(seen if in_a_dict else seen[sensors[0]])

        def look(self, name: str, reading: torch.Tensor) -> torch.Tensor:
            if name != FRONT:
                return reading
            coloured = torch.nn.functional.embedding(reading.long(), self.colours)
            return coloured.permute(0, 1, 4, 2, 3).reshape(1, 3 * frames, *reading.shape[2:])

    return Car()


def _of_stable_baselines3(model: Any, boxes: Mapping[str, tuple[int, ...]]) -> tuple[torch.nn.Module, int]:
    """The deterministic policy of a model as a module, and the number of its stacked frames."""
    import torch

    spaces = model.observation_space
    shapes = (
        {name: spaces[name].shape for name in boxes} if hasattr(spaces, "spaces") else {next(iter(boxes)): spaces.shape}
    )
    counts = {shape[0] / boxes[name][0] for name, shape in shapes.items() if shape[1:] == boxes[name][1:]}
    frames = int(counts.pop()) if len(counts) == 1 else 0
    if any(shape != (boxes[name][0] * frames, *boxes[name][1:]) for name, shape in shapes.items()):
        raise ValueError(
            f"the model observes {shapes}, which no stack of the observations of "
            "this environment is; VecNormalize goes around VecFrameStack"
        )
    # the last update left a distribution with gradients in the policy, which cannot be copied
    model.predict(spaces.sample(), deterministic=True)
    normal = model.get_vec_normalize_env()
    normal = normal if normal is not None and normal.norm_obs else None

    class Policy(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.net = model.policy

        def forward(self, seen: Any) -> torch.Tensor:
            net: Any = self.net
            if normal is not None:
                seen = _normalised(seen, normal, shapes)
            if hasattr(net, "q_net"):
                return net.q_net(seen)
            if hasattr(net, "actor"):
                return net.actor(seen, deterministic=True) if hasattr(net.actor, "log_std") else net.actor(seen)
            features = net.extract_features(seen, net.pi_features_extractor)
            return net.action_net(net.mlp_extractor.forward_actor(features))

    return Policy(), frames


def _normalised(seen: Any, normal: Any, shapes: Mapping[str, tuple[int, ...]]) -> Any:
    """The observation as ``VecNormalize`` presents it."""
    import torch

    def scale(value: torch.Tensor, statistics: Any, shape: tuple[int, ...]) -> torch.Tensor:
        if statistics.mean.shape != shape:
            raise ValueError("put VecNormalize around VecFrameStack: inside, its zeros before the first are not known")
        mean, deviation = (
            torch.from_numpy(one.astype(np.float32))
            for one in (statistics.mean, np.sqrt(statistics.var + normal.epsilon))
        )
        return torch.clip((value - mean) / deviation, -normal.clip_obs, normal.clip_obs)

    if not isinstance(seen, dict):
        return scale(seen, normal.obs_rms, next(iter(shapes.values())))
    keys = normal.norm_obs_keys or ()
    return {
        name: scale(value, normal.obs_rms[name], shapes[name]) if name in keys else value
        for name, value in seen.items()
    }
