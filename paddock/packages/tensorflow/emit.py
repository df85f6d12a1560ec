"""Builds the ONNX graph: its values, nodes, weights and the changes of layout between them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paddock.errors import UserFault
from paddock.network.model import FLOAT as FLOAT_NUMBER
from paddock.network.model import Attribute, Node, Port
from paddock.network.written import NUMBERS, model_bytes
from paddock.packages.limits import PackageLimits

OPSET = 17
IR_VERSION = 8
FLOAT = np.dtype("<f4")
_TO_PLANAR, _FROM_PLANAR = (0, 3, 1, 2), (0, 2, 3, 1)


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
        if not self.planar:
            return self.shape
        batch, height, width, channels = self.shape
        return (batch, channels, height, width)


class Dead:
    """What comes out of the untaken side of a branch, as in TensorFlow's own executor."""


DEAD = Dead()
Value = Known | Tensor
Flow = Value | Dead


class Emitter:
    """Collects nodes. Values are named ``v1, v2, ...``; weights are stored once however often they are used."""

    def __init__(self, limits: PackageLimits) -> None:
        self._limits = limits
        self._nodes: list[Node] = []
        self._weights: dict[tuple, str] = {}
        self._arrays: dict[str, np.ndarray] = {}  # also keeps them: an array's id is a key as long as the array lives
        self._inputs: list[Port] = []
        self._made_by: dict[str, tuple[str, tuple[Tensor, ...], tuple]] = {}
        self._relaid: dict[tuple[str, bool], Tensor] = {}

    # --- adding

    def input(self, name: str, shape: tuple[int, ...], dtype: np.dtype) -> Tensor:
        self._inputs.append(Port(name, NUMBERS[dtype.str[1:]], list(shape)))
        return Tensor(name, shape, dtype)

    def node(
        self,
        op: str,
        inputs: Sequence[Value | np.ndarray],
        shape: tuple[int, ...],
        dtype: np.dtype = FLOAT,
        *,
        planar: bool = False,
        extra: tuple = (),
        **attributes: Attribute,
    ) -> Tensor:
        """Append a node with one output of TensorFlow's ``shape``. ``extra``: data for :meth:`made_by`."""
        if math.prod(shape) > self._limits.elements:
            raise UserFault("network_too_wide")
        if len(self._nodes) >= self._limits.graph_nodes:
            raise UserFault("graph_too_big", limit=self._limits.graph_nodes)
        names = [value.name if isinstance(value, Tensor) else self.weight(value) for value in inputs]
        result = Tensor(f"v{len(self._nodes) + 1}", tuple(int(size) for size in shape), dtype, planar)
        self._nodes.append(Node(op, names, [result.name], attributes))
        self._made_by[result.name] = (op, tuple(v for v in inputs if isinstance(v, Tensor)), extra)
        return result

    def weight(self, value: Known | np.ndarray) -> str:
        array = value.array if isinstance(value, Known) else value
        array = np.asarray(array, order="C")  # (ascontiguousarray would give a single number a dimension)
        key = (array.dtype.str, array.shape, array.tobytes() if array.size <= 64 else id(array))
        if key not in self._weights:
            name = f"w{len(self._arrays) + 1}"
            self._weights[key] = name
            self._arrays[name] = array
        return self._weights[key]

    def made_by(self, value: Value) -> tuple[str, tuple[Tensor, ...], tuple]:
        """The operation that made a tensor, its tensor inputs and its extra data."""
        if not isinstance(value, Tensor):
            return "", (), ()
        return self._made_by.get(value.name, ("", (), ()))

    # --- layout

    def interleaved(self, value: Tensor) -> Tensor:
        """The same tensor with channels last, as in TensorFlow."""
        return self._relay(value, planar=False) if value.planar else value

    def planar(self, value: Tensor) -> Tensor:
        """The same picture with channels first, as for ONNX convolutions."""
        return value if value.planar else self._relay(value, planar=True)

    def _relay(self, value: Tensor, *, planar: bool) -> Tensor:
        key = (value.name, planar)
        if key not in self._relaid:
            _, height, width, channels = value.shape
            target = Tensor("", value.shape, value.dtype, planar).stored_shape
            if channels == 1 or height * width == 1:  # the bytes stay where they are
                shape = np.array(target, np.int64)
                result = self.node("Reshape", [value, shape], value.shape, value.dtype, planar=planar)
            else:
                order = _TO_PLANAR if planar else _FROM_PLANAR
                result = self.node("Transpose", [value], value.shape, value.dtype, planar=planar, perm=list(order))
            self._relaid[key] = result
        return self._relaid[key]

    def reshaped(self, value: Tensor, shape: tuple[int, ...]) -> Tensor:
        """The same values in another shape; a reshape of a reshape goes back to the first one's input."""
        if value.shape == tuple(shape):
            return value
        value = self.interleaved(value)
        op, sources, _ = self.made_by(value)
        if op == "Reshape" and sources and not sources[0].planar:
            value = sources[0]
            if value.shape == tuple(shape):
                return value
        return self.node("Reshape", [value, np.array(shape, np.int64)], shape, value.dtype)

    # --- result

    def model(self, output: Tensor) -> bytes:
        """The finished model with ``output`` as its only output."""
        output = self.interleaved(output)
        last = Port(output.name, FLOAT_NUMBER, list(output.shape))
        return model_bytes(self._nodes, self._inputs, last, self._arrays, OPSET, IR_VERSION)
