"""An ONNX file as bytes, with each weight copied once.

Protobuf's own way (tensors made, put into a graph, the graph into a model, the model serialised) holds every weight up
to five times, which for 57 million of them is more than a gigabyte. The bytes are the same to the last one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import onnx
from onnx import helper

# fields of onnx.proto: GraphProto.initializer, TensorProto.raw_data, ModelProto.graph
_INITIALIZER, _RAW_DATA, _GRAPH = 5, 9, 7
_AFTER_INITIALIZERS = ("input", "output")  # their numbers are greater


def model_bytes(graph: onnx.GraphProto, weights: Mapping[str, np.ndarray], opset: int, ir_version: int) -> bytes:
    """What ``SerializeToString(deterministic=True)`` of the model gives when ``weights`` are ``graph``'s initializers,
    as raw bytes. ``graph`` itself has none."""
    behind = onnx.GraphProto()
    for name in _AFTER_INITIALIZERS:
        getattr(behind, name).extend(getattr(graph, name))
        graph.ClearField(name)
    parts: list[bytes | memoryview] = [graph.SerializeToString(deterministic=True)]
    for name, array in weights.items():
        parts += _tensor(name, array)
    parts.append(behind.SerializeToString(deterministic=True))
    before = onnx.ModelProto(ir_version=ir_version).SerializeToString(deterministic=True)
    after = onnx.ModelProto(opset_import=[helper.make_opsetid("", opset)]).SerializeToString(deterministic=True)
    return b"".join([before, _head(_GRAPH, sum(map(len, parts))), *parts, after])


def _tensor(name: str, array: np.ndarray) -> list[bytes | memoryview]:
    """A field ``initializer``: a TensorProto, whose raw data come last."""
    number = helper.np_dtype_to_tensor_dtype(array.dtype)
    said = onnx.TensorProto(name=name, data_type=number, dims=array.shape).SerializeToString(deterministic=True)
    raw = memoryview(np.ascontiguousarray(array).reshape(-1).view(np.uint8))
    said += _head(_RAW_DATA, len(raw))
    return [_head(_INITIALIZER, len(said) + len(raw)) + said, raw]


def _head(field: int, size: int) -> bytes:
    """Key and length of a length-delimited field."""
    return _varint(field << 3 | 2) + _varint(size)


def _varint(value: int) -> bytes:
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)
