"""Building blocks of hostile zips of stable-baselines3. Without torch their cases are skipped."""

from __future__ import annotations

import io
import json
from typing import Any

import pytest

from tests.hostile.parts import CAMERA, Upload, metadata, zipped

BOX = {":type:": "<class 'gymnasium.spaces.box.Box'>", ":serialized:": "", "dtype": "uint8", "_shape": [1, 120, 160]}
FIVE = {":type:": "<class 'gymnasium.spaces.discrete.Discrete'>", ":serialized:": "", "n": "5"}
SAID = {
    "policy_class": {":type:": "<class 'abc.ABCMeta'>", "__module__": "stable_baselines3.common.policies"},
    "policy_kwargs": {},
    "observation_space": BOX,
    "action_space": FIVE,
    "use_sde": False,
}
PIXELS = 120 * 160


def torch() -> Any:
    """The library, in a test that may have it."""
    return pytest.importorskip("torch", reason="training is not installed: make training")


def weights(**changes: Any) -> dict[str, Any]:
    """The tensors of a policy without layers between picture and head; other ones by name, with ``__`` for a dot."""
    made = torch()
    tensors = {"action_net.weight": made.zeros(5, PIXELS), "action_net.bias": made.zeros(5)}
    tensors |= {"value_net.weight": made.zeros(1, PIXELS), "value_net.bias": made.zeros(1)}
    return tensors | {name.replace("__", "."): tensor for name, tensor in changes.items()}


def saved(content: Any) -> bytes:
    """What ``torch.save`` makes of it."""
    file = io.BytesIO()
    torch().save(content, file)
    return file.getvalue()


def policy(content: Any = None, data: bytes | None = None, car: bytes | None = None, **said: Any) -> Upload:
    """A zip of stable-baselines3 and its metadata. ``content``: what is saved as ``policy.pth``, or its bytes.
    ``data``: its bytes; ``said``: what it says otherwise."""
    content = weights() if content is None else content
    pth = content if isinstance(content, bytes) else saved(content)
    data = json.dumps({**SAID, **said}).encode() if data is None else data
    torch()
    return [("model.zip", zipped(("data", data), ("policy.pth", pth))), ("model_metadata.json", car or metadata())]


__all__ = ["BOX", "CAMERA", "SAID", "policy", "saved", "torch", "weights"]
