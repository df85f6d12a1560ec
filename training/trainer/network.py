"""The policy's network: in torch for learning, in ONNX for racing, and back for cloning.

Every picture goes through its own convolutions, a lidar through a dense layer, and their features through one dense
layer to the heads. Depths, by the field's names: SHALLOW has two convolutions, DEEP_CONVOLUTIONAL_NETWORK three, DEEP
four.

A car of the old console is trained further as it was built there: its shallow network reads every pixel and is thirty
times as large (verified on a real one). Its deeper networks are refused, because no example of one is known.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .observations import POOL, Sense, senses_of

FEATURES = 128
LIDAR_FEATURES = 64
# (filters, size, stride) of each convolution on a pooled picture of 30 x 40
CONVOLUTIONS = {
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW": ((16, 5, 2), (32, 3, 2)),
    "DEEP_CONVOLUTIONAL_NETWORK": ((16, 5, 2), (32, 3, 2), (32, 3, 1)),
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP": ((16, 5, 2), (32, 3, 2), (32, 3, 1), (64, 3, 1)),
}
OF_THE_CONSOLE = {"DEEP_CONVOLUTIONAL_NETWORK_SHALLOW": ((32, 8, 4), (64, 4, 2), (64, 3, 1))}


@dataclass(frozen=True)
class Build:
    """How the networks of one maker are built: the pooling of pictures, convolutions by depth, width of the dense
    layer."""

    pool: int
    convolutions: Mapping[str, tuple[tuple[int, int, int], ...]]
    features: int


OURS, CONSOLE = "paddock", "console"
BUILDS = {OURS: Build(POOL, CONVOLUTIONS, FEATURES), CONSOLE: Build(1, OF_THE_CONSOLE, 512)}


def build_of(metadata: Mapping[str, Any], parameters: int) -> str | None:
    """The name of the build with so many weights for this metadata, or None: a guess, which :func:`from_onnx`
    checks."""
    for name in BUILDS:
        try:
            if NetworkLayout.of(metadata, name).parameters == parameters:
                return name
        except LookupError:
            continue
    return None


@dataclass(frozen=True)
class NetworkLayout:
    """The sizes of a network for one ``model_metadata.json``."""

    senses: tuple[Sense, ...]
    convolutions: tuple[tuple[int, int, int], ...]
    outputs: int
    features: int = FEATURES

    @classmethod
    def of(cls, metadata: Mapping[str, Any], build: str = OURS) -> "NetworkLayout":
        """The network that a training with this metadata makes, or learns on, by the name of its build.

        Raises LookupError for a depth or a sensor that the build does not have.
        """
        built = BUILDS[build]
        discrete = metadata["action_space_type"] == "discrete"
        return cls(
            tuple(senses_of(metadata["sensor"], metadata.get("lidar_config"), built.pool)),
            built.convolutions[metadata["neural_network"]],
            len(metadata["action_space"]) if discrete else 2,
            built.features,
        )

    @property
    def row_scale(self) -> float:
        """The factor from a row of bytes to the network's input; 1 for scaled rows."""
        return self.senses[0].scale if self.senses[0].pool == 1 else 1.0

    def picture_shape(self, shape: tuple[int, ...]) -> tuple[int, int, int]:
        """The shape behind the convolutions of a picture, both as (channels, rows, columns)."""
        _, rows, columns = shape
        for _, size, stride in self.convolutions:
            rows, columns = (rows - size) // stride + 1, (columns - size) // stride + 1
        return self.convolutions[-1][0], rows, columns

    @property
    def joined(self) -> int:
        """The inputs of the dense layer that all sensors share."""
        return sum(
            math.prod(self.picture_shape(sense.shape)) if sense.spec.is_picture else LIDAR_FEATURES
            for sense in self.senses
        )

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shapes of all weights by their names, in the order in which they are used."""
        found: dict[str, tuple[int, ...]] = {}
        for sense in self.senses:
            if not sense.spec.is_picture:
                found[f"{sense.name}.dense"] = (LIDAR_FEATURES, *sense.shape)
                found[f"{sense.name}.dense_bias"] = (LIDAR_FEATURES,)
                continue
            channels = sense.shape[0]
            for number, (filters, size, _) in enumerate(self.convolutions):
                found[f"{sense.name}.conv{number}"] = (filters, channels, size, size)
                found[f"{sense.name}.conv{number}_bias"] = (filters,)
                channels = filters
        found["dense"], found["dense_bias"] = (self.features, self.joined), (self.features,)
        found["head"], found["head_bias"] = (self.outputs, self.features), (self.outputs,)
        return found

    @property
    def parameters(self) -> int:
        """The number of the policy's weights, as the gate counts them."""
        return sum(int(np.prod(shape)) for shape in self.shapes.values())


def to_onnx(layout: NetworkLayout, weights: Mapping[str, np.ndarray], squash: bool) -> bytes:
    """The deterministic policy by the ONNX contract: from the sensors' readings to one row of outputs. ``squash``: with
    a tanh at the end. The pooling of pictures comes first; the scale of an input goes into its first weights."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    arrays = {name: np.array(weights[name], np.float32) for name in layout.shapes}
    nodes, inputs, found = [], [], []

    def node(kind: str, sources: list[str], made: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, sources, [made], **attributes))
        return made

    for sense in layout.senses:
        name = sense.name
        inputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, sense.spec.channels_first))
        first = f"{name}.conv0" if sense.spec.is_picture else f"{name}.dense"
        arrays[first] = arrays[first] * np.float32(sense.scale)
        if not sense.spec.is_picture:
            value = node("Gemm", [name, first, f"{first}_bias"], f"{name}.lidar", transB=1)
            found.append(node("Relu", [value], f"{name}.flat"))
            continue
        value = name
        if sense.pool > 1:
            value = node("AveragePool", [name], f"{name}.pooled", kernel_shape=[POOL, POOL], strides=[POOL, POOL])
        for number, (_, size, stride) in enumerate(layout.convolutions):
            sources = [value, f"{name}.conv{number}", f"{name}.conv{number}_bias"]
            value = node("Conv", sources, f"{name}.seen{number}", kernel_shape=[size, size], strides=[stride, stride])
            value = node("Relu", [value], f"{name}.on{number}")
        found.append(node("Flatten", [value], f"{name}.flat", axis=1))
    joined = found[0] if len(found) == 1 else node("Concat", found, "joined", axis=1)
    value = node("Gemm", [joined, "dense", "dense_bias"], "features", transB=1)
    value = node("Relu", [value], "features_on")
    value = node("Gemm", [value, "head", "head_bias"], "raw" if squash else "actions", transB=1)
    if squash:
        node("Tanh", [value], "actions")
    graph = helper.make_graph(
        nodes,
        "paddock-training",
        inputs,
        [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, layout.outputs])],
        [numpy_helper.from_array(np.ascontiguousarray(array), name) for name, array in arrays.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], producer_name="paddock")
    model.ir_version = 10
    onnx.checker.check_model(model)
    return model.SerializeToString(deterministic=True)


def from_onnx(layout: NetworkLayout, data: bytes) -> dict[str, np.ndarray]:
    """The weights of a canonical network of this layout: one of :func:`to_onnx`, or a converted car of the console,
    whose convolutions are flattened with the channels last. Raises ValueError for another network."""
    return _GraphReader(layout, data).read()


class _GraphReader:
    """The way back through a network's graph, from its output to its sensors."""

    def __init__(self, layout: NetworkLayout, data: bytes) -> None:
        import onnx
        from onnx import helper, numpy_helper

        self._layout = layout
        graph = onnx.load_from_string(data).graph
        self._end = graph.output[0].name
        self._stored = {one.name: numpy_helper.to_array(one) for one in graph.initializer}
        self._makers = {node.output[0]: node for node in graph.node}
        self._attributes = lambda node: {one.name: helper.get_attribute_value(one) for one in node.attribute}
        self._weights: dict[str, np.ndarray] = {}

    def read(self) -> dict[str, np.ndarray]:
        layout, weights = self._layout, self._weights
        # what a softmax makes of the scores changes neither the best action nor what is learned from them
        end = self._before(self._end, "Tanh", "Softmax")
        joined = self._dense(self._weigh(self._back(end, "Gemm"), "head"))
        count = len(layout.senses)
        parts = [joined] if count == 1 else list(self._back(joined, "Concat").input)
        if len(parts) != count:
            raise ValueError(f"{len(parts)} sensors, not {count}")
        for sense, part in zip(layout.senses, parts, strict=True):
            first = f"{sense.name}.conv0" if sense.spec.is_picture else f"{sense.name}.dense"
            if sense.spec.is_picture:
                value = self._picture(sense, part)
            else:
                value = self._weigh(self._back(self._back(part, "Relu").input[0], "Gemm"), first)
            if value != sense.name:
                raise ValueError(f"{sense.name} does not come first")
            weights[first] = weights[first] / np.float32(sense.scale)
        if not all(np.isfinite(array).all() for array in weights.values()):
            raise ValueError("weights that are not finite")
        return weights

    def _dense(self, found: str) -> str:
        """Take the weights of the layer that made ``found``; its input: a row, or the last picture where the gate wrote
        a large layer as a convolution (:mod:`paddock.network.dense`)."""
        made = self._makers.get(found)
        if made is None or made.op_type != "Reshape":
            return self._weigh(self._back(self._back(found, "Relu").input[0], "Gemm"), "dense")
        layer = self._back(self._back(made.input[0], "Relu").input[0], "Conv")
        kernel = self._stored.get(layer.input[1])
        if kernel is None or set(self._attributes(layer)) != {"kernel_shape"}:
            raise ValueError("a dense layer in a form of its own")
        self._stored[layer.input[1]] = kernel.reshape(len(kernel), -1)
        return self._before(self._weigh(layer, "dense"), "Reshape")

    def _picture(self, sense: Sense, flat: str) -> str:
        """Take the convolutions of one camera, from their flattened end; the value that they start from."""
        value = self._unflattened(sense, flat)
        for number in reversed(range(len(self._layout.convolutions))):
            made = self._back(self._back(value, "Relu").input[0], "Conv")
            _, _, stride = self._layout.convolutions[number]
            attributes = self._attributes(made)
            plain = {"strides": [stride] * 2, "group": 1, "dilations": [1, 1], "auto_pad": b"NOTSET", "pads": [0] * 4}
            if {**plain, **attributes, "kernel_shape": 0} != {**plain, "kernel_shape": 0}:
                raise ValueError(f"a convolution with {attributes}")
            value = self._weigh(made, f"{sense.name}.conv{number}")
        if sense.pool > 1:
            return self._before(self._back(value, "AveragePool").input[0], "Cast")
        if sense.shape[0] == 1:  # one channel: channels first or last are the same numbers in the same order
            value = self._before(value, "Reshape")
        return self._before(value, "Cast")

    def _unflattened(self, sense: Sense, flat: str) -> str:
        """The value before the flattening. The dense layer's columns are ordered as torch flattens."""
        made = self._makers.get(flat)
        if made is not None and made.op_type == "Relu":  # the dense layer reads the picture as it is
            return flat
        if made is None or made.op_type not in ("Flatten", "Reshape"):
            raise ValueError("Flatten expected")
        turned = self._makers.get(made.input[0])
        if turned is None or turned.op_type != "Transpose":
            return made.input[0]
        if self._attributes(turned)["perm"] != [0, 2, 3, 1] or len(self._layout.senses) > 1:
            raise ValueError("values in an order of their own")
        channels, rows, columns = self._layout.picture_shape(sense.shape)
        dense = self._weights["dense"].reshape(-1, rows, columns, channels)
        self._weights["dense"] = np.ascontiguousarray(dense.transpose(0, 3, 1, 2)).reshape(len(dense), -1)
        return turned.input[0]

    def _back(self, value: str, kind: str) -> Any:
        """The node that makes ``value``. Raises ValueError if it is of another kind."""
        made = self._makers.get(value)
        if made is None or made.op_type != kind:
            raise ValueError(f"{kind} expected, not {made.op_type if made else 'an input'}")
        return made

    def _before(self, value: str, *kinds: str) -> str:
        """The input of the node that makes ``value`` if it is of these kinds, else ``value`` itself."""
        made = self._makers.get(value)
        return made.input[0] if made is not None and made.op_type in kinds else value

    def _weigh(self, made: Any, name: str) -> str:
        """Take the weights of a node; its input."""
        if len(made.input) != 3:
            raise ValueError(f"{made.op_type} without a bias")
        for key, source in ((name, made.input[1]), (f"{name}_bias", made.input[2])):
            array = self._stored.get(source)
            if array is None or array.shape != self._layout.shapes[key]:
                raise ValueError(f"{key} has the shape {None if array is None else array.shape}")
            self._weights[key] = array.astype(np.float32)
        if made.op_type == "Gemm":
            attributes = {"alpha": 1.0, "beta": 1.0, "transA": 0, **self._attributes(made)}
            if attributes != {"alpha": 1.0, "beta": 1.0, "transA": 0, "transB": 1}:
                raise ValueError(f"a dense layer with {attributes}")
        return made.input[0]
