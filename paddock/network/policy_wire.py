"""The fixed-size messages between a referee and a model, shared by both ends (no onnxruntime here).

    request  uint32 step, then the observation of each sensor in sorted name order, in the sensor's dtype and shape;
             where both ends share memory that holds them, the observations lie there, and the request is the step
    reply    uint32 step, uint32 way (one of :data:`WAYS`), then float32[n]

Everything is little-endian. The header that both ends know: ``{"inputs": [{"name", "dtype", "shape"}], "outputs": n,
"ranges": [[low, high], [low, high]] or null}``; ``ranges`` as in :class:`paddock.simulator.action.ActionSpace`. A
header without ``ranges`` asks for the runtime's answer as it is. ``"frames": n``, where it is there: the network reads
the last n observations at once, and the model's end keeps them. A run begins with step :data:`FIRST`.
"""

from __future__ import annotations

import ctypes
import math
import struct
from typing import Any

import numpy as np

Buffer = bytearray | ctypes.Array[ctypes.c_ubyte]

STEP = struct.Struct("<I")
FIRST = 1
REPLY = struct.Struct("<II")
# how a step was answered: by float32; by float64, as float32 was too near a boundary; by float32, and float64 confirmed
# its bound; by float64, as that showed the bound to be wrong
WAYS = FAST, EXACT, CHECKED, EXCEEDED = range(4)


def observations_of(header: dict[str, Any]) -> list[tuple[str, np.dtype, tuple[int, ...]]]:
    """Name, dtype and shape of each sensor, in the order of a request."""
    sensors = sorted(header["inputs"], key=lambda sensor: sensor["name"])
    return [(sensor["name"], np.dtype(sensor["dtype"]).newbyteorder("<"), tuple(sensor["shape"])) for sensor in sensors]


def request_buffer(header: dict[str, Any]) -> tuple[bytearray, dict[str, np.ndarray]]:
    """A request of the right size, and for each sensor an array of its dtype and shape that lies in it."""
    buffer = bytearray(STEP.size + observation_bytes(header))
    return buffer, observations_in(header, buffer, STEP.size)


def observation_bytes(header: dict[str, Any]) -> int:
    """Bytes that the observations of a step take."""
    return sum(math.prod(shape) * dtype.itemsize for _, dtype, shape in observations_of(header))


def observations_in(header: dict[str, Any], memory: Buffer, offset: int = 0) -> dict[str, np.ndarray]:
    """For each sensor an array of its dtype and shape that lies in ``memory`` from ``offset`` on."""
    observations = {}
    for name, dtype, shape in observations_of(header):
        flat = np.frombuffer(memoryview(memory), dtype, math.prod(shape), offset)
        observations[name] = flat.reshape(shape)
        offset += flat.nbytes
    return observations


def reply_buffer(header: dict[str, Any]) -> tuple[bytearray, np.ndarray]:
    """A reply of the right size and the float32[n] action that lies in it."""
    count = int(header["outputs"])
    buffer = bytearray(REPLY.size + 4 * count)
    return buffer, np.frombuffer(buffer, np.dtype("<f4"), count, REPLY.size)
