"""Writes a plain network as OpenVINO's intermediate representation, without OpenVINO."""

# The format is a description in XML and the numbers beside it. OpenVINO's package has 180 MB, and would convert only
# some forty operations, each of which the format has under another name. Version 10 with operations of the sets 1 to 5:
# the cars' own OpenVINO of 2021 reads it, and every later one. Pictures have the channels first, as the cars' converter
# writes them. Format: docs.openvino.ai, "Operation Sets" and "Intermediate Representation".

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from .plain import Const, Operand, Plain, PlainOperation, Value
from .policy import Head

VERSION = 10
_TYPES = {"<f4": ("f32", "FP32"), "<i4": ("i32", "I32"), "|u1": ("u8", "U8"), "<i8": ("i64", "I64")}
_TYPES["|b1"] = ("boolean", "BOOL")
_NUMPY = {"auto_broadcast": "numpy"}
# type, set, attributes
_LAYERS: dict[str, tuple[str, int, dict[str, str]]] = {
    "abs": ("Abs", 1, {}), "neg": ("Negative", 1, {}), "sqrt": ("Sqrt", 1, {}), "exp": ("Exp", 1, {}),
    "log": ("Log", 1, {}), "erf": ("Erf", 1, {}), "floor": ("Floor", 1, {}), "ceil": ("Ceiling", 1, {}),
    "round": ("Round", 5, {"mode": "half_to_even"}), "sign": ("Sign", 1, {}), "sigmoid": ("Sigmoid", 1, {}),
    "tanh": ("Tanh", 1, {}), "relu": ("ReLU", 1, {}), "softplus": ("SoftPlus", 4, {}), "not": ("LogicalNot", 1, {}),
    "add": ("Add", 1, _NUMPY), "sub": ("Subtract", 1, _NUMPY), "mul": ("Multiply", 1, _NUMPY),
    "div": ("Divide", 1, {**_NUMPY, "m_pythondiv": "true"}), "pow": ("Power", 1, _NUMPY),
    "min": ("Minimum", 1, _NUMPY), "max": ("Maximum", 1, _NUMPY), "and": ("LogicalAnd", 1, _NUMPY),
    "or": ("LogicalOr", 1, _NUMPY), "equal": ("Equal", 1, _NUMPY), "less": ("Less", 1, _NUMPY),
    "greater": ("Greater", 1, _NUMPY), "less_equal": ("LessEqual", 1, _NUMPY),
    "greater_equal": ("GreaterEqual", 1, _NUMPY), "where": ("Select", 1, _NUMPY),
    "matmul": ("MatMul", 1, {"transpose_a": "false", "transpose_b": "false"}),
    "reshape": ("Reshape", 1, {"special_zero": "false"}), "transpose": ("Transpose", 1, {}),
    "take": ("Gather", 1, {}), "pad": ("Pad", 1, {"pad_mode": "constant"}),
    "broadcast": ("Broadcast", 3, {"mode": "numpy"}),
    "mean": ("ReduceMean", 1, {}), "sum": ("ReduceSum", 1, {}), "most": ("ReduceMax", 1, {}),
    "least": ("ReduceMin", 1, {}), "max_pool": ("MaxPool", 1, {}), "mean_pool": ("AvgPool", 1, {"exclude-pad": "true"}),
    "conv": ("Convolution", 1, {}), "softmax": ("SoftMax", 1, {}), "concat": ("Concat", 1, {}),
    "cast": ("Convert", 1, {}),
}  # fmt: skip
_EDGELESS = {"pads_begin": "0,0", "pads_end": "0,0", "auto_pad": "explicit"}


class _Layer:
    """One layer of the description. ``element``: attributes of its ``data``."""

    def __init__(
        self, name: str, kind: str, version: int, element: dict[str, str], dtype: np.dtype, shape: Sequence[int]
    ) -> None:
        self.name, self.kind, self.version, self.element = name, kind, version, element
        self.dtype, self.shape = dtype, tuple(shape)
        self.inputs: list[int] = []


class _Description:
    def __init__(self, plain: Plain, head: Head) -> None:
        self._plain, self._head = plain, head
        self._layers: list[_Layer] = []
        self._at: dict[str, int] = {}  # values
        self._known: dict[tuple, int] = {}  # numbers
        self._kept: list[np.ndarray] = []
        self._numbers: list[memoryview] = []
        self._size = 0

    def written(self) -> tuple[bytes, bytes]:
        for sensor, value in self._plain.inputs.items():
            options = {"element_type": _TYPES[value.dtype.str][0], "shape": _commas(value.shape)}
            layer = _Layer(self._head.input_name(sensor), "Parameter", 1, options, value.dtype, value.shape)
            self._at[value.name] = self._append(layer)
        for operation in self._plain.operations:
            self._write(operation)
        output = self._plain.output
        assert output is not None
        self._layers[self._at[output.name]].name = self._head.name
        result = _Layer(f"{self._head.name}/sink", "Result", 1, {}, output.dtype, ())
        result.inputs = [self._at[output.name]]
        self._append(result)
        return self._xml().encode(), b"".join(self._numbers)

    def _append(self, layer: _Layer) -> int:
        self._layers.append(layer)
        return len(self._layers) - 1

    def _operand(self, one: Operand) -> int:
        return self._at[one.name] if isinstance(one, Value) else self._const(one.array)

    def _whole(self, *values: int) -> int:
        return self._const(np.array(values, np.int64))

    def _const(self, array: np.ndarray) -> int:
        found = (array.dtype.str, array.shape, array.tobytes() if array.size <= 64 else id(array))
        if found not in self._known:
            self._kept.append(array)
            raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
            options = {"element_type": _TYPES[array.dtype.str][0], "shape": _commas(array.shape)}
            options |= {"offset": str(self._size), "size": str(len(raw))}
            self._known[found] = self._append(
                _Layer(f"const_{len(self._known)}", "Const", 1, options, array.dtype, array.shape)
            )
            padding = -len(raw) % 64  # where processors like their numbers to begin
            self._numbers += [raw, memoryview(bytes(padding))]
            self._size += len(raw) + padding
        return self._known[found]

    def _write(self, operation: PlainOperation) -> None:
        kind, options, output = operation.kind, operation.attributes, operation.output
        name, version, attributes = _LAYERS[kind]
        inputs = [self._operand(one) for one in operation.inputs]
        attributes = dict(attributes)
        if kind == "conv":
            attributes |= _EDGELESS | {name: _commas(options[name]) for name in ("strides", "dilations")}
            if options["groups"] > 1:
                name = "GroupConvolution"
                kernel = operation.inputs[1]
                assert isinstance(kernel, Const)
                groups = kernel.array.reshape((options["groups"], -1, *kernel.shape[1:]))
                inputs[1] = self._const(groups)
        elif kind in ("max_pool", "mean_pool"):
            attributes |= _EDGELESS | {name: _commas(options[name]) for name in ("strides", "kernel")}
            attributes["rounding_type"] = "floor"
        elif kind == "reshape" or kind == "broadcast":
            inputs.append(self._whole(*output.shape))
        elif kind == "transpose":
            inputs.append(self._whole(*options["order"]))
        elif kind == "take":
            inputs.append(self._const(np.array(options["axis"], np.int64)))
        elif kind == "pad":
            fill = self._const(np.array(options["number"], output.dtype))
            inputs += [self._whole(*options["before"]), self._whole(*options["after"]), fill]
        elif "keep" in options:
            attributes["keep_dims"] = "true" if options["keep"] else "false"
            inputs.append(self._whole(*options["axes"]))
        elif kind == "concat":
            attributes["axis"] = str(options["axis"])
        elif kind == "softmax":
            attributes["axis"] = str(len(output.shape) - 1)
        elif kind == "cast":
            attributes["destination_type"] = _TYPES[output.dtype.str][0]
        layer = _Layer(
            f"{self._head.scope}/{name}_{len(self._layers)}", name, version, attributes, output.dtype, output.shape
        )
        layer.inputs = inputs
        self._at[output.name] = self._append(layer)

    def _xml(self) -> str:
        lines = ['<?xml version="1.0"?>', f'<net name="car" version="{VERSION}">', "<layers>"]
        edges = []
        for at, layer in enumerate(self._layers):
            about = f'id="{at}" name={quoteattr(layer.name)} type="{layer.kind}" version="opset{layer.version}"'
            lines.append(f"<layer {about}>")
            if layer.element:
                data = " ".join(f"{name}={quoteattr(value)}" for name, value in layer.element.items())
                lines.append(f"<data {data}/>")
            if layer.inputs:
                ports = [_port(port, self._layers[source]) for port, source in enumerate(layer.inputs)]
                lines += ["<input>", *ports, "</input>"]
                edges += [
                    f'<edge from-layer="{source}" from-port="{len(self._layers[source].inputs)}" '
                    f'to-layer="{at}" to-port="{port}"/>'
                    for port, source in enumerate(layer.inputs)
                ]
            if layer.kind != "Result":
                lines += ["<output>", _port(len(layer.inputs), layer), "</output>"]
            lines.append("</layer>")
        return "\n".join([*lines, "</layers>", "<edges>", *edges, "</edges>", "</net>", ""])


def write_ir(plain: Plain, head: Head) -> tuple[bytes, bytes]:
    """The content of ``model.xml`` and ``model.bin``."""
    return _Description(plain, head).written()


def _port(number: int, layer: _Layer) -> str:
    dims = "".join(f"<dim>{size}</dim>" for size in layer.shape)
    return f'<port id="{number}" precision="{_TYPES[layer.dtype.str][1]}">{dims}</port>'


def _commas(numbers: Sequence[int]) -> str:
    return ",".join(str(int(number)) for number in numbers)
