"""Lowers a canonical network to plain operations."""

# Values that depend on no sensor are computed here by the engine's own reference. Pictures arrive as the field's graphs
# take them, float32 from 0 to 255, whatever the network declared.

from collections.abc import Callable

import numpy as np

from paddock.errors import UserFault
from paddock.network.arithmetic import ARITHMETIC
from paddock.network.arrangement import ARRANGEMENT
from paddock.network.canonical import CanonicalNetwork
from paddock.network.layers import LAYERS
from paddock.network.model import DTYPES, UINT8, Node
from paddock.network.resize import resize
from paddock.network.wire import printable
from paddock.packages.inputs import InputSpec

from .plain import FLOAT, Const, Operand, Plain, Value


class Unsayable(Exception):
    """A node without an equivalent in plain operations."""


class Lowering:
    """The plain network under construction, for the converters of operators."""

    def __init__(self, opset: int) -> None:
        self.opset = opset
        self.plain = Plain()

    def number(self, value: float) -> Const:
        return Const(np.array(value, FLOAT))

    def binary(self, kind: str, left: Operand | float, right: Operand | float) -> Value:
        """Element by element, of values and plain numbers."""
        sides = [self.number(side) if isinstance(side, float | int) else side for side in (left, right)]
        return self.plain.binary(kind, *sides)

    def known(self, operand: Operand | None) -> np.ndarray:
        """The array of an input that must not depend on a sensor. Raises :class:`Unsayable`."""
        if not isinstance(operand, Const):
            raise Unsayable
        return operand.array

    def arrays(self, *operands: Operand | None) -> list[np.ndarray | None]:
        return [None if operand is None else self.known(operand) for operand in operands]


OperandOrNone = Operand | None
Inputs = list[OperandOrNone]
Lowered = Operand | tuple[Operand, ...]
Converter = Callable[..., Lowered]
CONVERTERS: dict[str, Converter] = {}
# operators that move bytes like floats
_MOVING = {
    *("Identity", "Concat", "Flatten", "Reshape", "Squeeze", "Unsqueeze", "Transpose", "Slice", "Split", "Gather"),
    *("DepthToSpace", "SpaceToDepth", "Shape"),
}


def lowers(*ops: str, value_first: bool = True) -> Callable[[Converter], Converter]:
    """Register the converter of ONNX operators, which takes the inputs one by one. With ``value_first`` the first input
    is always a :class:`Value`."""

    def register(function: Converter) -> Converter:
        def of_value(to: Lowering, node: Node, x: OperandOrNone, *inputs: OperandOrNone) -> Lowered:
            if not isinstance(x, Value):
                raise Unsayable
            return function(to, node, x, *inputs)

        CONVERTERS.update(dict.fromkeys(ops, of_value if value_first else function))
        return function

    return register


def lower(network: CanonicalNetwork, specs: dict[str, InputSpec]) -> Plain:
    """The network in plain operations. ``specs``: of its inputs, by sensor.

    Raises UserFault ``export_operator`` for an operator without an equivalent.
    """
    lowering = Lowering(network.opset)
    values: dict[str, Operand] = {name: Const(array, name) for name, array in network.weights.items()}
    bytes_: set[str] = set()  # values that are bytes in the network, and floats here
    for port in network.inputs:
        spec = specs[port.name]
        values[port.name] = _read(lowering.plain, spec, port.sizes)
        if port.dtype == UINT8:
            bytes_.add(port.name)
    for node in network.nodes:
        inputs = [values[name] if name else None for name in node.inputs]
        reads_bytes = any(name in bytes_ for name in node.inputs)
        try:
            made = _lowered(lowering, node, inputs, reads_bytes)
        except (Unsayable, LookupError, ValueError, TypeError, AttributeError) as error:
            raise _fault(node) from error
        results = made if isinstance(made, tuple) else (made,)
        for name, result in zip(node.outputs, results, strict=False):
            values[name] = result
            if reads_bytes and node.op in _MOVING and node.op != "Shape":
                bytes_.add(name)
    output = values[network.output.name]
    if not isinstance(output, Value) or output.dtype != FLOAT:
        raise UserFault("export_operator", operator="Constant", where="-")
    lowering.plain.output = output
    lowering.plain.prune()
    return lowering.plain


def _fault(node: Node) -> UserFault:
    return UserFault("export_operator", operator=printable(node.op, 40), where=printable(node.outputs[0], 80) or "-")


def _read(plain: Plain, spec: InputSpec, declared: tuple[int, ...]) -> Operand:
    """A sensor in the network's layout: pictures channels first or last."""
    value = plain.input(spec.sensor, spec.channels_first)
    if spec.is_picture and declared != spec.channels_first:
        return plain.transpose(value, (0, 2, 3, 1))
    return value


def _lowered(lowering: Lowering, node: Node, inputs: Inputs, reads_bytes: bool) -> Lowered:
    given = [one for one in inputs if one is not None]
    if node.op == "Cast" and reads_bytes:
        if DTYPES[node.whole("to")] != FLOAT:
            raise Unsayable
        return given[0]
    if reads_bytes and node.op not in _MOVING:
        raise Unsayable
    if node.op == "Shape":
        return Const(np.asarray(ARRANGEMENT["Shape"](node, np.broadcast_to(np.zeros((), "?"), given[0].shape))))
    if all(isinstance(one, Const) for one in given):
        return _computed(node, inputs)
    if any(one.dtype == np.float16 for one in given):
        raise Unsayable  # half precision rounds elsewhere in every runtime
    converter = CONVERTERS.get(node.op)
    if converter is None:
        raise Unsayable
    return converter(lowering, node, *inputs)


def _computed(node: Node, inputs: Inputs) -> Lowered:
    """The result of a node that depends on no sensor."""
    function = LAYERS.get(node.op) or ARRANGEMENT.get(node.op) or ARITHMETIC.get(node.op)
    if node.op == "Resize":
        function = resize
    if function is None:
        raise Unsayable
    arrays = [one.array if isinstance(one, Const) else None for one in inputs]
    wide = [a.astype(np.float64) if a is not None and a.dtype.kind == "f" else a for a in arrays]
    with np.errstate(all="ignore"):
        made = function(node, *wide)
    results = made if isinstance(made, tuple) else (made,)
    return tuple(Const(_narrow(np.asarray(result))) for result in results)


def _narrow(array: np.ndarray) -> np.ndarray:
    return array.astype(FLOAT) if array.dtype.kind == "f" else array
