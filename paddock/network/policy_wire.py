"""The fixed-size messages between a referee and a model."""

# request  uint32 step, then the observation of each sensor in sorted name order, in the sensor's dtype and shape;
#          where both ends share memory for the observations, the request is the step alone
# reply    uint32 step, uint32 way (one of :data:`WAYS`), then float32[n]
#
# Everything is little-endian. A run begins with step :data:`FIRST`.

import ctypes
import math
import struct
from typing import NotRequired, TypedDict

import numpy as np

Buffer = bytearray | ctypes.Array[ctypes.c_ubyte]

STEP = struct.Struct("<I")
FIRST = 1
REPLY = struct.Struct("<II")
# The ways of an answer: float32; float64, as float32 was too near a boundary; float32, whose bound float64 confirmed;
# float64, which showed that the bound is wrong.
WAYS = FAST, EXACT, CHECKED, EXCEEDED = range(4)


class PolicyInput(TypedDict):
    name: str
    dtype: str
    shape: list[int]


class PolicyHeader(TypedDict):
    """The header that both ends know. ``outputs``: the number of values; ``ranges``: as in
    :class:`paddock.simulator.action.ActionSpace`, left out for the runtime's unchecked answer; ``frames``: the number
    of last observations that the network reads at once, which the model's end keeps."""

    inputs: list[PolicyInput]
    outputs: int
    ranges: NotRequired[list[list[float]] | None]
    frames: NotRequired[int]


def observations_of(header: PolicyHeader) -> list[tuple[str, np.dtype, tuple[int, ...]]]:
    """Name, dtype and shape of each sensor, in the order of a request."""
    sensors = sorted(header["inputs"], key=lambda sensor: sensor["name"])
    return [(sensor["name"], np.dtype(sensor["dtype"]).newbyteorder("<"), tuple(sensor["shape"])) for sensor in sensors]


def request_buffer(header: PolicyHeader) -> tuple[bytearray, dict[str, np.ndarray]]:
    """A request of the right size, and for each sensor an array of its dtype and shape that lies in it."""
    buffer = bytearray(STEP.size + observation_bytes(header))
    return buffer, observations_in(header, buffer, STEP.size)


def observation_bytes(header: PolicyHeader) -> int:
    return sum(math.prod(shape) * dtype.itemsize for _, dtype, shape in observations_of(header))


def observations_in(header: PolicyHeader, memory: Buffer, offset: int = 0) -> dict[str, np.ndarray]:
    """For each sensor an array of its dtype and shape that lies in ``memory`` from ``offset`` on."""
    observations = {}
    for name, dtype, shape in observations_of(header):
        flat = np.frombuffer(memoryview(memory), dtype, math.prod(shape), offset)
        observations[name] = flat.reshape(shape)
        offset += flat.nbytes
    return observations


def reply_buffer(header: PolicyHeader) -> tuple[bytearray, np.ndarray]:
    """A reply of the right size and the float32[n] action that lies in it."""
    count = int(header["outputs"])
    buffer = bytearray(REPLY.size + 4 * count)
    return buffer, np.frombuffer(buffer, np.dtype("<f4"), count, REPLY.size)
