"""What flows through the conversion: known arrays, tensors known by shape, and nothing at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Known:
    """A value that is known now: a weight, a shape, a constant."""

    array: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        return self.array.shape

    @property
    def dtype(self) -> np.dtype:
        return self.array.dtype


@dataclass(frozen=True, eq=False)
class Tensor:
    """A value that depends on the sensors: the ONNX value ``name``.

    ``shape`` is TensorFlow's (pictures NHWC). ``planar`` means that the ONNX value holds it channels first (NCHW).
    """

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype
    planar: bool = False

    @property
    def stored_shape(self) -> tuple[int, ...]:
        """The shape of the ONNX value itself."""
        if not self.planar:
            return self.shape
        batch, height, width, channels = self.shape
        return (batch, channels, height, width)


class Dead:
    """What comes out of the untaken side of a branch, as in TensorFlow's own executor."""


DEAD = Dead()
Value = Known | Tensor
Flow = Value | Dead
