"""The sandboxed process that converts a stable-baselines3 policy; besides the trainer the only one with torch.

Started by ``evaluation.garage.admission``, with the protocol of ``evaluation.garage.conversion_process``. From the
pickle inside ``policy.pth`` torch loads tensors only (``weights_only=True``); ``data`` is JSON.
"""

import io
from collections.abc import Mapping

import numpy as np

from evaluation.sandbox.frames import LOCKED, MAX_NETWORK, read_message, write_message
from paddock.errors import UserFault
from paddock.packages.admission import admit_network
from paddock.packages.kinds import ONNX
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata

from ..trainer import torch_imports  # noqa: F401  before torch: without its compiler, and one thread
from .facts import read_facts
from .rebuild import rebuild, with_frame_stack

import torch  # isort: skip

DATA = "data"
_FLOATS = (torch.float32, torch.float64, torch.float16, torch.bfloat16)


def main(frames_in: int, frames_out: int) -> int:
    """Answer one question: ``{limits, weights: ["data"]}`` with ``policy.pth``, the metadata and ``data`` as blobs in,
    the canonical network out, and how many observations it reads at once."""
    write_message(frames_out, LOCKED)
    header, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)
    limits = PackageLimits(**header["limits"])
    policy, metadata_json, *rest = blobs
    del blobs
    try:
        metadata = parse_metadata(metadata_json, limits)
        facts = read_facts(dict(zip(header["weights"], rest, strict=True)).get(DATA, b""))
        metadata = with_frame_stack(facts, metadata)
        tensors = read_tensors(policy, limits)
        del policy
        shapes = {name: tuple(tensor.shape) for name, tensor in tensors.items()}
        network = rebuild(shapes, lambda name: as_array(tensors[name]), facts, metadata)
        tensors.clear()
        canonical = admit_network(ONNX, network, metadata, limits)
    except UserFault as fault:
        write_message(frames_out, {"state": "refused", "error": fault.to_dict()})
        return 0
    answer = {
        "state": "admitted",
        "parameters": canonical.parameters,
        "macs": canonical.macs,
        "facts": canonical.facts.to_dict(),
        "frame_stack": metadata.frame_stack,
    }
    write_message(frames_out, answer, [canonical.onnx])
    return 0


def read_tensors(policy: bytes, limits: PackageLimits) -> dict[str, torch.Tensor]:
    """The weights of ``policy.pth`` by name. Raises UserFault ``sb3_unreadable``; MemoryError."""
    try:
        found = torch.load(io.BytesIO(policy), map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises various types for malformed bytes
        if "alloc" in str(error):
            raise MemoryError from error
        raise UserFault("sb3_unreadable", member="policy.pth") from error
    if not isinstance(found, Mapping) or not found or not all(isinstance(name, str) for name in found):
        raise UserFault("sb3_unreadable", member="policy.pth")
    for tensor in found.values():
        plain = type(tensor) is torch.Tensor and tensor.layout is torch.strided and tensor.device.type == "cpu"
        if not plain or tensor.dtype not in _FLOATS or tensor.numel() > limits.tensor_elements:
            raise UserFault("sb3_unreadable", member="policy.pth")
    return dict(found)


def as_array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().to(torch.float32).contiguous().numpy()


def _warm_up() -> None:
    """Load a file once before the lock, so that torch imports all modules for it."""
    file = io.BytesIO()
    torch.save({"weight": torch.zeros(2, 2)}, file)
    as_array(read_tensors(file.getvalue(), PackageLimits())["weight"])


_warm_up()
