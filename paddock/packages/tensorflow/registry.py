"""Which function converts which TensorFlow operation, and what such a function may use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from paddock.errors import UserFault
from paddock.packages.limits import PackageLimits

from .emit import Emitter
from .graph import TensorflowNode
from .values import Flow, Known, Tensor, Value


class Contradiction(Exception):
    """Sizes, types or attributes of a node do not fit each other."""


class Unsupported(Exception):
    """A node that no conversion exists for, or not with these attributes."""


@dataclass
class Context:
    """What a converter gets besides its node and inputs."""

    emit: Emitter
    limits: PackageLimits
    nodes: int = 0

    def count_node(self) -> None:
        """Functions may call functions: bounds how many nodes are converted in all of them together."""
        self.nodes += 1
        if self.nodes > self.limits.graph_nodes:
            raise UserFault("graph_too_big", limit=self.limits.graph_nodes)


Converter = Callable[[Context, TensorflowNode, list[Value]], Sequence[Flow]]
CONVERTERS: dict[str, Converter] = {}


def converts(*ops: str) -> Callable[[Converter], Converter]:
    """Register a converter: it gets the live inputs and returns the values of the node's outputs."""

    def register(function: Converter) -> Converter:
        for op in ops:
            assert op not in CONVERTERS, op
            CONVERTERS[op] = function
        return function

    return register


def require(condition: bool) -> None:
    """Raise :class:`Contradiction` unless the condition holds."""
    if not condition:
        raise Contradiction


def known(value: Value) -> np.ndarray:
    """The array of an input that must be known now."""
    if not isinstance(value, Known):
        raise Unsupported
    return value.array


def integers(value: Value) -> list[int]:
    """A known input as a list of whole numbers."""
    array = known(value)
    require(array.dtype.kind in "iu" and array.size <= 64)
    return [int(number) for number in array.reshape(-1)]


def tensor(value: Value) -> Tensor:
    """An input that must depend on the sensors."""
    if not isinstance(value, Tensor):
        raise Unsupported
    return value


def axis_of(value: Value, rank: int) -> int:
    """A known input as one axis, counted from the front."""
    numbers = integers(value)
    require(len(numbers) == 1)
    return axes_of(numbers, rank)[0]


def axes_of(raw: list[int], rank: int) -> list[int]:
    """Axes counted from the front, each once."""
    axes = [axis + rank if axis < 0 else axis for axis in raw]
    require(all(0 <= axis < rank for axis in axes) and len(set(axes)) == len(axes))
    return axes
