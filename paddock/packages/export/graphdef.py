"""Writes a plain network as a frozen TensorFlow GraphDef, without TensorFlow."""

# TensorFlow's layers expect pictures with the channels last: each value keeps the layout in which it was computed, and
# is transposed only where an operation needs the other one. Message layouts: tensorflow/core/framework/{graph,node_def,
# attr_value,tensor,tensor_shape,types}.proto. All operations are older than TensorFlow 2, and TFLite has each of them.

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from paddock.errors import UserFault
from paddock.network.wire import BYTES
from paddock.network.written import key, message, number, text, varint

from .plain import BINARY, COMPARING, REDUCING, UNARY, Const, Operand, Plain, PlainOperation, Step, Value
from .policy import Head

MARK = "_paddock"  # TensorFlow leaves attributes alone whose names begin so
_PRODUCER = 27  # of TensorFlow 1.13, which the console wrote its cars with
_NUMBERS = {"<f4": 1, "<i4": 3, "|u1": 4, "<i8": 9, "|b1": 10}
_TO_LAST, _TO_FIRST = (0, 2, 3, 1), (0, 3, 1, 2)
_LAST_OF = {0: 0, 1: 3, 2: 1, 3: 2}  # where an axis stands with the channels last
_MOST_GROUPS = 256
_NAMES = {
    "abs": "Abs", "neg": "Neg", "sqrt": "Sqrt", "exp": "Exp", "log": "Log", "erf": "Erf", "floor": "Floor",
    "ceil": "Ceil", "round": "Round", "sign": "Sign", "sigmoid": "Sigmoid", "tanh": "Tanh", "relu": "Relu",
    "softplus": "Softplus", "not": "LogicalNot", "add": "Add", "sub": "Sub", "mul": "Mul", "div": "RealDiv",
    "pow": "Pow", "min": "Minimum", "max": "Maximum", "and": "LogicalAnd", "or": "LogicalOr", "equal": "Equal",
    "less": "Less", "greater": "Greater", "less_equal": "LessEqual", "greater_equal": "GreaterEqual", "mean": "Mean",
    "sum": "Sum", "most": "Max", "least": "Min", "where": "SelectV2", "cast": "Cast", "conv": "Conv2D",
    "max_pool": "MaxPool", "mean_pool": "AvgPool", "matmul": "MatMul", "softmax": "Softmax", "reshape": "Reshape",
    "transpose": "Transpose", "concat": "ConcatV2", "take": "GatherV2", "pad": "PadV2", "broadcast": "BroadcastTo",
}  # fmt: skip
_UNTYPED = {"not", "and", "or"}

Part = bytes | memoryview


@dataclass
class Written:
    """A graph but for its policy: parts to be joined, where each weight of the network stands in them, and what the
    policy's node does with which other."""

    parts: list[Part] = field(default_factory=list)
    weights: dict[str, tuple[str, tuple[Step, ...]]] = field(default_factory=dict)  # node and steps by weight
    last: tuple[str, str] = ("Identity", "")


@dataclass
class _Layouts:
    """The nodes of one value, by layout; None where it was not asked for yet."""

    first: str | None = None
    last: str | None = None
    scope: str = ""


def write_graph(plain: Plain, head: Head) -> Written:
    """The graph without its last node, :func:`policy_node`, which carries the attributes that describe the others.

    Raises UserFault ``export_operator``.
    """
    return _GraphOf(plain, head).written()


def policy_node(written: Written, head: Head, mark: bytes) -> bytes:
    """The policy's node and the graph's version. ``mark``: data for :mod:`paddock.packages.tensorflow.ours`."""
    op, source = written.last
    node = _node(head.name, op, [source], {"T": _type(np.dtype("<f4")), MARK: message(2, mark)})
    return node + message(4, number(1, _PRODUCER))


class _GraphOf:
    def __init__(self, plain: Plain, head: Head) -> None:
        self._plain, self._head = plain, head
        self._result = Written()
        self._stored: dict[str, _Layouts] = {}
        self._counts: dict[str, int] = {}
        self._constants: dict[tuple, str] = {}
        self._kept: list[np.ndarray] = []  # an array's id is a key as long as the array lives

    def written(self) -> Written:
        for sensor, value in self._plain.inputs.items():
            picture = len(value.shape) == 4
            shape = [-1, *(value.shape[axis] for axis in (_TO_LAST[1:] if picture else range(1, len(value.shape))))]
            name = self._head.input_name(sensor)
            placeholder = {"dtype": _type(value.dtype), "shape": message(7, _shape(shape))}
            self._result.parts.append(_node(name, "Placeholder", [], placeholder))
            stored = _Layouts(last=name) if picture else _Layouts(first=name)
            stored.scope = f"{self._head.scope}/{sensor}"
            self._stored[value.name] = stored
        output, operations = self._plain.output, self._plain.operations
        assert output is not None
        last = operations[-1] if operations and operations[-1].output is output else None
        is_soft = last is not None and last.kind == "softmax"
        for operation in operations[: -1 if is_soft else None]:
            self._write(operation)
        if last is not None and is_soft:
            self._result.last = ("Softmax", self._operand_of(self._head.scope, last.inputs[0]))
        else:
            self._result.last = ("Identity", self.name_of(output))
        return self._result

    # --- values

    def name_of(self, value: Value, *, last: bool = False) -> str:
        """The node that holds a value, with its channels first or last."""
        stored = self._stored[value.name]
        wanted = stored.last if last else stored.first
        if wanted is not None:
            return wanted
        other = stored.first if last else stored.last
        assert other is not None
        made = self._turned(stored.scope, other, value, last)
        if last:
            stored.last = made
        else:
            stored.first = made
        return made

    def _turned(self, scope: str, source: str, value: Value, last: bool) -> str:
        _, channels, height, width = value.shape
        if channels == 1 or height * width == 1:  # the numbers stay where they are
            sizes = (height, width, channels) if last else (channels, height, width)
            return self._reshaped(scope, source, value.dtype, (1, *sizes))
        order = self._constant(scope, Const(np.array(_TO_LAST if last else _TO_FIRST, np.int32)), "perm")
        types = {"T": _type(value.dtype), "Tperm": _type(np.dtype("<i4"))}
        return self._node(scope, "Transpose", [source, order], types)

    def _reshaped(self, scope: str, source: str, dtype: np.dtype, shape: Sequence[int]) -> str:
        # the first of the axes is the batch: any number of frames goes through
        sizes = [-1, *shape[1:]] if shape and shape[0] == 1 else list(shape)
        to = self._constant(scope, Const(np.array(sizes, np.int32)), "shape")
        return self._node(scope, "Reshape", [source, to], {"T": _type(dtype), "Tshape": _type(np.dtype("<i4"))})

    def _has_last(self, *values: Operand) -> bool:
        return any(isinstance(one, Value) and self._stored[one.name].last is not None for one in values)

    def _operand(self, scope: str, one: Operand, last: bool) -> str:
        if isinstance(one, Value):
            return self.name_of(one, last=last)
        if last and one.array.ndim:
            if one.array.ndim < 4:
                one = one.reshaped((1,) * (4 - one.array.ndim) + one.shape)
            one = one.transposed(_TO_LAST)
        return self._constant(scope, one, "const")

    def _constant(self, scope: str, const: Const, what: str) -> str:
        """A node of numbers; small ones are written once."""
        array = np.asarray(const.array)
        small = array.size <= 64
        marked = array.tobytes() if small else (const.origin or id(array), const.steps)
        found = (scope, array.dtype.str, array.shape, marked)
        if found not in self._constants:
            name = self._name(f"{scope}/{what}")
            self._constants[found] = name
            if not small:
                self._kept.append(array)
                if const.origin:
                    self._result.weights.setdefault(const.origin, (name, const.steps))
            self._result.parts += _const_node(name, array)
        return self._constants[found]

    # --- nodes

    def _name(self, wanted: str) -> str:
        count = self._counts.get(wanted, 0)
        self._counts[wanted] = count + 1
        return f"{wanted}_{count}"

    def _node(self, scope: str, op: str, inputs: Sequence[str], attributes: dict[str, bytes]) -> str:
        name = self._name(f"{scope}/{op}")
        self._result.parts.append(_node(name, op, inputs, attributes))
        return name

    def _write(self, operation: PlainOperation) -> None:
        scopes = {self._stored[one.name].scope for one in operation.inputs if isinstance(one, Value)}
        scope = scopes.pop() if len(scopes) == 1 else f"{self._head.scope}/middleware_fc_embedder"
        kind, output = operation.kind, operation.output
        if kind in UNARY or kind in BINARY or kind in COMPARING or kind in ("where", "cast"):
            name, last = self._elementwise(scope, operation)
        elif kind in ("conv", "max_pool", "mean_pool"):
            name, last = self._windowed(scope, operation), True
        elif kind in ("transpose", "reshape"):
            name, last = self._rearranged(scope, operation)
        elif kind in ("concat", "take", "pad") or kind in REDUCING:
            name, last = self._along(scope, operation)
        else:
            name, last = self._plainly(scope, operation), False
        stored = _Layouts(last=name, scope=scope) if last else _Layouts(first=name, scope=scope)
        self._stored[output.name] = stored

    def _elementwise(self, scope: str, operation: PlainOperation) -> tuple[str, bool]:
        kind, inputs, output = operation.kind, operation.inputs, operation.output
        pictures = all(len(one.shape) == 4 for one in inputs if isinstance(one, Value))
        last = pictures and len(output.shape) == 4 and self._has_last(*inputs)
        names = [self._operand(scope, one, last) for one in inputs]
        types = {} if kind in _UNTYPED else {"T": _type(inputs[-1].dtype)}
        if kind == "cast":
            types = {"SrcT": _type(inputs[0].dtype), "DstT": _type(output.dtype)}
        return self._node(scope, _NAMES[kind], names, types), last

    def _windowed(self, scope: str, operation: PlainOperation) -> str:
        source, options = operation.inputs[0], operation.attributes
        assert isinstance(source, Value)
        name = self.name_of(source, last=True)
        strides = _integers([1, *options["strides"], 1])
        common = {"T": _type(source.dtype), "strides": strides, "padding": message(2, b"VALID")}
        common["data_format"] = message(2, b"NHWC")
        if operation.kind != "conv":
            common["ksize"] = _integers([1, *options["kernel"], 1])
            return self._node(scope, _NAMES[operation.kind], [name], common)
        kernel = operation.inputs[1]
        assert isinstance(kernel, Const)
        common["dilations"] = _integers([1, *options["dilations"], 1])
        groups = options["groups"]
        if groups == 1:
            weight = self._constant(scope, kernel.transposed((2, 3, 1, 0)), "kernel")
            return self._node(scope, "Conv2D", [name, weight], common)
        even = len(set(options["strides"])) == 1 and set(options["dilations"]) == {1}
        if groups == source.shape[1] and even:
            rows = kernel.reshaped((groups, -1, *kernel.shape[2:])).transposed((2, 3, 0, 1))
            weight = self._constant(scope, rows, "depthwise_kernel")
            return self._node(scope, "DepthwiseConv2dNative", [name, weight], common)
        return self._grouped(scope, name, kernel, groups, common)

    def _grouped(self, scope: str, source: str, kernel: Const, groups: int, common: dict[str, bytes]) -> str:
        """Convolve each group separately and concatenate the results."""
        if groups > _MOST_GROUPS:
            raise UserFault("export_operator", operator="Conv", where=f"group={groups}")
        axis = self._constant(scope, Const(np.array(3, np.int32)), "axis")
        typed = {"T": common["T"], "num_split": number(3, groups)}
        parts = self._node(scope, "Split", [axis, source], typed)
        each = kernel.shape[0] // groups
        made = []
        for group in range(groups):
            own = Const(np.ascontiguousarray(kernel.array[group * each : (group + 1) * each].transpose(2, 3, 1, 0)))
            weight = self._constant(scope, own, "kernel")
            made.append(self._node(scope, "Conv2D", [f"{parts}:{group}" if group else parts, weight], common))
        return self._concatenated(scope, made, 3, np.dtype("<f4"))

    def _concatenated(self, scope: str, names: Sequence[str], axis: int, dtype: np.dtype) -> str:
        at = self._constant(scope, Const(np.array(axis, np.int32)), "axis")
        types = {"T": _type(dtype), "N": number(3, len(names)), "Tidx": _type(np.dtype("<i4"))}
        return self._node(scope, "ConcatV2", [*names, at], types)

    def _rearranged(self, scope: str, operation: PlainOperation) -> tuple[str, bool]:
        (source,), output = operation.inputs, operation.output
        assert isinstance(source, Value)
        before, after, order = source.shape, output.shape, operation.attributes.get("order")
        if len(before) == len(after) == 4:  # a mere change of the layout
            if order is None:
                channels = {before[1]: _TO_LAST, before[3]: _TO_FIRST}.get(1) if 1 in (before[1], before[3]) else None
                order = channels if channels and after == tuple(before[axis] for axis in channels) else None
            if order == _TO_LAST:
                return self.name_of(source, last=True), False
            if order == _TO_FIRST and self._stored[source.name].first is not None:
                return self.name_of(source), True
        name = self.name_of(source)
        if operation.kind == "reshape":
            return self._reshaped(scope, name, source.dtype, after), False
        perm = self._constant(scope, Const(np.array(order, np.int32)), "perm")
        types = {"T": _type(source.dtype), "Tperm": _type(np.dtype("<i4"))}
        return self._node(scope, "Transpose", [name, perm], types), False

    def _along(self, scope: str, operation: PlainOperation) -> tuple[str, bool]:
        """Operations along axes, in the layout of their input."""
        kind, inputs, options, output = operation.kind, operation.inputs, operation.attributes, operation.output
        source = inputs[0]
        last = len(source.shape) == len(output.shape) == 4 and self._has_last(*inputs)
        place = _LAST_OF if last else {axis: axis for axis in range(len(source.shape))}
        whole = _type(np.dtype("<i4"))
        if kind == "concat":
            names = [self._operand(scope, one, last) for one in inputs]
            return self._concatenated(scope, names, place[options["axis"]], output.dtype), last
        name = self._operand(scope, source, last)
        typed = {"T": _type(source.dtype)}
        if kind == "take":
            lines = self._operand(scope, inputs[1], False)
            axis = self._constant(scope, Const(np.array(place[options["axis"]], np.int32)), "axis")
            typed = {"Tparams": typed["T"], "Tindices": whole, "Taxis": whole}
            return self._node(scope, "GatherV2", [name, lines, axis], typed), last
        if kind == "pad":
            edges = np.zeros((len(source.shape), 2), np.int32)
            for number_of_axis, sides in enumerate(zip(options["before"], options["after"], strict=True)):
                edges[place[number_of_axis]] = sides
            width = self._constant(scope, Const(edges), "paddings")
            fill = self._constant(scope, Const(np.array(options["number"], source.dtype)), "const")
            return self._node(scope, "PadV2", [name, width, fill], {**typed, "Tpaddings": whole}), last
        axes = Const(np.array(sorted(place[axis] for axis in options["axes"]), np.int32))
        over = self._constant(scope, axes, "reduction_indices")
        typed |= {"Tidx": whole, "keep_dims": number(5, int(options["keep"]))}
        return self._node(scope, _NAMES[kind], [name, over], typed), last

    def _plainly(self, scope: str, operation: PlainOperation) -> str:
        kind, inputs, output = operation.kind, operation.inputs, operation.output
        typed = {"T": _type(inputs[0].dtype)}
        names = [self._operand_of(scope, one) for one in inputs]
        if kind == "matmul":
            off = number(5, 0)
            if len(inputs[0].shape) == len(inputs[1].shape) == 2:
                return self._node(scope, "MatMul", names, {**typed, "transpose_a": off, "transpose_b": off})
            return self._node(scope, "BatchMatMulV2", names, {**typed, "adj_x": off, "adj_y": off})
        if kind == "broadcast":
            shape = self._constant(scope, Const(np.array(output.shape, np.int32)), "shape")
            return self._node(scope, "BroadcastTo", [*names, shape], {**typed, "Tidx": _type(np.dtype("<i4"))})
        return self._node(scope, _NAMES[kind], names, typed)

    def _operand_of(self, scope: str, one: Operand) -> str:
        return self.name_of(one) if isinstance(one, Value) else self._constant(scope, one, "kernel")


# --- messages


def _node(name: str, op: str, inputs: Sequence[str], attributes: dict[str, bytes]) -> bytes:
    head = text(1, name) + text(2, op) + b"".join(text(3, source) for source in inputs)
    return message(1, head + b"".join(_attribute(name, attributes[name]) for name in sorted(attributes)))


def _attribute(name: str, value: bytes) -> bytes:
    return message(5, text(1, name) + message(2, value))


def _const_node(name: str, array: np.ndarray) -> Iterator[Part]:
    """A node of numbers, which are not copied where they are contiguous."""
    raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
    head = number(1, _NUMBERS[array.dtype.str]) + message(2, _shape(array.shape))
    if array.size == 1:  # as TensorFlow writes single numbers: some readers look for them there only
        tensor: list[Part] = [head + _single(array)]
    else:
        tensor = [head + key(4, BYTES) + varint(len(raw)), raw]
    for number_of_field, around in ((8, b""), (2, text(1, "value")), (5, b"")):
        size = sum(map(len, tensor))
        tensor = [around + key(number_of_field, BYTES) + varint(size), *tensor]
    typed = _attribute("dtype", _type(array.dtype))
    node = [text(1, name) + text(2, "Const") + typed, *tensor]
    yield key(1, BYTES) + varint(sum(map(len, node)))
    yield from node


def _single(array: np.ndarray) -> bytes:
    value = array.reshape(-1)[0]
    if array.dtype.kind == "f":
        return message(5, struct.pack("<f", value))
    place = {"<i4": 7, "|u1": 7, "<i8": 10, "|b1": 11}[array.dtype.str]
    return message(place, varint(int(value) & (1 << 64) - 1))


def _shape(sizes: Sequence[int]) -> bytes:
    return b"".join(message(2, number(1, size)) for size in sizes)


def _type(dtype: np.dtype) -> bytes:
    return number(6, _NUMBERS[dtype.str])


def _integers(values: Sequence[int]) -> bytes:
    return message(1, message(3, b"".join(varint(value) for value in values)))
