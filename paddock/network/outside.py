"""Reads weights that an ONNX file keeps in separate files, as ``torch.onnx.export`` writes them."""

# Only files of the upload are read, as bytes in memory; no path is ever followed. Format: onnx/onnx.proto,
# TensorProto.external_data.

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from paddock.errors import UserFault

from .wire import printable

_DIGITS = 15  # of an offset or a length: no file is larger
_NAME_LIMIT = 255


class FileBounds(Protocol):
    """The limits of a file; those of an upload are in :class:`paddock.packages.limits.PackageLimits`."""

    @property
    def wire_fields(self) -> int: ...
    @property
    def nodes(self) -> int: ...
    @property
    def tensor_elements(self) -> int: ...
    @property
    def model_bytes(self) -> int: ...


class OutsideWeights:
    """The files of weights by name. Tensors may share a place, within the limit of all bytes read."""

    def __init__(self, files: Mapping[str, bytes], limits: FileBounds) -> None:
        self._files = files
        self._limit = limits.model_bytes
        self._left = limits.model_bytes

    def read(self, entries: Mapping[str, str], dtype: np.dtype, dims: list[int]) -> np.ndarray:
        """The values of a tensor. ``entries``: its entries ``location``, ``offset``, ``length``.

        Raises UserFault ``onnx_external_data``, ``onnx_external_missing`` or ``model_too_large``."""
        name = entries.get("location", "")
        allowed = name.isprintable() and name not in ("", ".", "..") and not set(name) & set("/\\")
        if not allowed or len(name) > _NAME_LIMIT:
            raise UserFault("onnx_external_data", problem=f"in {printable(name, 60) or 'no file'}")
        offset, length = (_number(entries.get(key)) for key in ("offset", "length"))
        content = self._files.get(name)
        if content is None:
            raise UserFault("onnx_external_missing", file=printable(name, 120))
        offset = offset or 0
        length = len(content) - offset if length is None else length
        if length != math.prod(dims) * dtype.itemsize or offset + length > len(content):
            raise UserFault("onnx_external_data", problem=f"where {printable(name, 60)} does not fit them")
        self._left -= length
        if self._left < 0:
            raise UserFault("model_too_large", limit_mb=self._limit >> 20)
        array = np.frombuffer(content, dtype, math.prod(dims), offset)
        if dtype.kind == "b" and array.view("u1").max(initial=0) > 1:
            raise UserFault("onnx_tensor")
        return array.reshape(dims)


def _number(text: str | None) -> int | None:
    if text is None:
        return None
    if not text.isascii() or not text.isdigit() or len(text) > _DIGITS:
        raise UserFault("onnx_external_data", problem="at a place that is not a number")
    return int(text)
