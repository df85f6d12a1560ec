"""Weights that an ONNX file keeps in files beside it, as ``torch.onnx.export(..., external_data=True)`` writes them.

Only files that came with the upload are looked at, as bytes that are in memory already; no path is ever followed.
Format: onnx/onnx.proto, TensorProto.external_data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from paddock.errors import UserFault

from .wire import printable

if TYPE_CHECKING:
    from .model import FileBounds

_DIGITS = 15  # of an offset or a length: no file is larger
_NAME_LIMIT = 255


class OutsideWeights:
    """The files of weights, by name, and how much was read out of them: two tensors may share a place, but not so
    many that a small upload becomes a large network."""

    def __init__(self, files: Mapping[str, bytes], limits: FileBounds) -> None:
        self._files = files
        self._limit = limits.model_bytes
        self._left = limits.model_bytes

    def read(self, said: Mapping[str, str], dtype: np.dtype, dims: list[int]) -> np.ndarray:
        """The values of a tensor. ``said``: its entries ``location``, ``offset``, ``length``.

        Raises UserFault ``onnx_external_data``, ``onnx_external_missing`` or ``model_too_large``."""
        name = said.get("location", "")
        if (
            not name
            or len(name) > _NAME_LIMIT
            or name in (".", "..")
            or not name.isprintable()
            or set(name) & set("/\\")
        ):
            raise UserFault("onnx_external_data", problem=f"in {printable(name, 60) or 'no file'}")
        offset, length = (_number(said.get(key)) for key in ("offset", "length"))
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
