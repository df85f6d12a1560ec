"""The registry of conversion functions for TensorFlow operations, with their helpers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from paddock.errors import UserFault
from paddock.packages.limits import PackageLimits

from .emit import Emitter, Flow, Known, Tensor, Value


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
        """Bound the nodes of all functions together, because functions may call functions."""
        self.nodes += 1
        if self.nodes > self.limits.graph_nodes:
            raise UserFault("graph_too_big", limit=self.limits.graph_nodes)


Converter = Callable[..., Value | Sequence[Flow]]
CONVERTERS: dict[str, Converter] = {}


Registered = TypeVar("Registered", bound=Converter)


def converts(*ops: str) -> Callable[[Registered], Registered]:
    """Register a converter: it takes the live inputs one by one (another number of them is a TypeError) and returns the
    node's output, or a list of all outputs."""

    def register(function: Registered) -> Registered:
        for op in ops:
            assert op not in CONVERTERS, op
            CONVERTERS[op] = function
        return function

    return register


def require(condition: bool) -> None:
    if not condition:
        raise Contradiction


def known(value: Value) -> np.ndarray:
    if not isinstance(value, Known):
        raise Unsupported
    return value.array


def integers(value: Value) -> list[int]:
    array = known(value)
    require(array.dtype.kind in "iu" and array.size <= 64)
    return [int(number) for number in array.reshape(-1)]


def tensor(value: Value) -> Tensor:
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
