"""Weights of a dense layer in the order in which the runtime's fastest kernel reads them, arranged by the runtime.

Its convolutions work on blocks of channels, 8 or 16 of them by the processor, and bring their weights into that order
while a session is made: 23 MB are copied four times on the way. There is a shorter one. Weights of a convolution whose
kernel is as large as its picture lie as the picture's pixels do, in whatever blocks; and a row can be taken for a
picture that lies in blocks already, :data:`CHANNELS` of them, for its values come in the same order. So only the
outputs of a dense layer have to be brought into blocks, and that is what the runtime's own operator for pictures does:
once, straight to where the session reads them. (A kernel of one pixel would do as well, but is read a tenth slower.)
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import onnxruntime

from .fields import message, number, text
from .model import FLOAT

DOMAIN = "com.microsoft.nchwc"  # of the runtime's operators on blocks
CHANNELS = 16  # whole blocks on every processor
ALIGNED = 64  # bytes: where its kernels read at full speed
_IR_VERSION, _OPSET = 10, 17


def in_blocks(weights: np.ndarray) -> np.ndarray | None:
    """Float32 weights (outputs, inputs), both multiples of ``CHANNELS``, as the kernel of a convolution of ``DOMAIN``
    over a picture (1, CHANNELS, 1, inputs / CHANNELS): aligned. None where the runtime has no such operators on this
    processor."""
    arrange = arranger()
    if arrange is None:
        return None
    weights = np.ascontiguousarray(weights, np.float32)
    arranged = aligned_room(weights.shape)
    try:
        arrange(weights, arranged)
    except MemoryError:
        raise
    except Exception:  # a runtime that has changed: it arranges them itself, as it does without us
        return None
    outputs, inputs = weights.shape
    return arranged.reshape(outputs, CHANNELS, 1, inputs // CHANNELS)


def aligned_room(shape: tuple[int, ...], dtype: type | np.dtype = np.float32) -> np.ndarray:
    """A new array, not cleared, that begins at a multiple of ``ALIGNED``."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = np.empty(size + ALIGNED, np.uint8)
    start = -room.ctypes.data % ALIGNED
    return room[start : start + size].view(dtype).reshape(shape)


@functools.cache
def arranger() -> Callable[[np.ndarray, np.ndarray], None] | None:
    """What arranges the first array into the second. The first call takes milliseconds."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(_picture_in_blocks(), options, providers=["CPUExecutionProvider"])
    except Exception:  # processors without blocks, whose runtime has no such operator
        return None

    def arrange(weights: np.ndarray, arranged: np.ndarray) -> None:
        outputs, inputs = weights.shape
        binding = session.io_binding()
        picture = [1, outputs, 1, inputs]  # an output is a channel, its weights lie along a line
        binding.bind_input("from", "cpu", 0, np.float32, picture, weights.ctypes.data)
        binding.bind_output("to", "cpu", 0, np.float32, picture, arranged.ctypes.data)
        session.run_with_iobinding(binding)

    return arrange


def _picture_in_blocks() -> bytes:
    """An ONNX file of one operator, whose sizes are known when it runs."""
    floats = message(2, message(1, number(1, FLOAT)))
    graph = message(1, text(1, "from") + text(2, "to") + text(4, "ReorderInput") + text(7, DOMAIN))
    graph += text(2, "blocks") + message(11, text(1, "from") + floats) + message(12, text(1, "to") + floats)
    operators = message(8, text(1, "") + number(2, _OPSET)) + message(8, text(1, DOMAIN) + number(2, 1))
    return number(1, _IR_VERSION) + message(7, graph) + operators
