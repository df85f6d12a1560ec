"""The policy's network: in torch for learning, in ONNX for racing, and back again for cloning.

Every picture goes through convolutions of its own, a lidar through a dense layer; what they find goes through one dense
layer to the heads. Depths, by the field's names: SHALLOW has two convolutions, as the prototype that learned to lap a
hairpin track in ten seconds; DEEP_CONVOLUTIONAL_NETWORK three; DEEP four.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .senses import POOL, Sense, senses_of

FEATURES = 128
LIDAR_FEATURES = 64
# (filters, size, stride) of each convolution on a pooled picture of 30 x 40
CONVOLUTIONS = {
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW": ((16, 5, 2), (32, 3, 2)),
    "DEEP_CONVOLUTIONAL_NETWORK": ((16, 5, 2), (32, 3, 2), (32, 3, 1)),
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP": ((16, 5, 2), (32, 3, 2), (32, 3, 1), (64, 3, 1)),
}


@dataclass(frozen=True)
class Layout:
    """The sizes of a network for one ``model_metadata.json``."""

    senses: tuple[Sense, ...]
    convolutions: tuple[tuple[int, int, int], ...]
    outputs: int

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> Layout:
        """The network that a training with this metadata makes. KeyError for an unknown depth."""
        discrete = metadata["action_space_type"] == "discrete"
        return cls(
            tuple(senses_of(metadata["sensor"], metadata.get("lidar_config"))),
            CONVOLUTIONS[metadata["neural_network"]],
            len(metadata["action_space"]) if discrete else 2,
        )

    def picture_features(self, shape: tuple[int, ...]) -> int:
        """How many numbers the convolutions make of a pooled picture (channels, rows, columns)."""
        _, rows, columns = shape
        for _, size, stride in self.convolutions:
            rows, columns = (rows - size) // stride + 1, (columns - size) // stride + 1
        return self.convolutions[-1][0] * rows * columns

    @property
    def joined(self) -> int:
        """The inputs of the dense layer that all sensors share."""
        return sum(
            self.picture_features(sense.shape) if sense.spec.is_picture else LIDAR_FEATURES for sense in self.senses
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
        found["dense"], found["dense_bias"] = (FEATURES, self.joined), (FEATURES,)
        found["head"], found["head_bias"] = (self.outputs, FEATURES), (self.outputs,)
        return found

    @property
    def parameters(self) -> int:
        """How many weights the policy has, as the gate counts them."""
        return sum(int(np.prod(shape)) for shape in self.shapes.values())


def to_onnx(layout: Layout, weights: Mapping[str, np.ndarray], squash: bool) -> bytes:
    """The deterministic policy by the ONNX contract: each sensor as it is read, to one row. ``squash``: tanh at the
    end, for a policy that was learned so.

    The pictures' pooling comes first; the scale of an input goes into the weights that meet it. Written operator by
    operator, so that the file holds nothing but what is needed.
    """
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


def from_onnx(layout: Layout, data: bytes) -> dict[str, np.ndarray]:
    """The weights out of a canonical network that :func:`to_onnx` wrote once, whatever its values are called now.

    Raises ValueError where the network is built in another way.
    """
    import onnx
    from onnx import numpy_helper

    graph = onnx.load_from_string(data).graph
    stored = {one.name: numpy_helper.to_array(one) for one in graph.initializer}
    makers = {node.output[0]: node for node in graph.node}
    weights: dict[str, np.ndarray] = {}

    def back(value: str, kind: str) -> Any:
        made = makers.get(value)
        if made is None or made.op_type != kind:
            raise ValueError(f"{kind} expected, not {made.op_type if made else 'an input'}")
        return made

    def weigh(made: Any, name: str) -> str:
        if len(made.input) != 3:
            raise ValueError(f"{made.op_type} without a bias")
        for key, source in ((name, made.input[1]), (f"{name}_bias", made.input[2])):
            array = stored.get(source)
            if array is None or array.shape != layout.shapes[key]:
                raise ValueError(f"{key} has the shape {None if array is None else array.shape}")
            weights[key] = array.astype(np.float32)
        return made.input[0]

    end = graph.output[0].name
    if end in makers and makers[end].op_type == "Tanh":
        end = makers[end].input[0]
    features = back(weigh(back(end, "Gemm"), "head"), "Relu").input[0]
    joined = weigh(back(features, "Gemm"), "dense")
    count = len(layout.senses)
    parts = [joined] if count == 1 else list(back(joined, "Concat").input)
    if len(parts) != count:
        raise ValueError(f"{len(parts)} sensors, not {count}")
    for sense, part in zip(layout.senses, parts, strict=True):
        first = f"{sense.name}.conv0" if sense.spec.is_picture else f"{sense.name}.dense"
        if sense.spec.is_picture:
            value = back(part, "Flatten").input[0]
            for number in reversed(range(len(layout.convolutions))):
                value = weigh(back(back(value, "Relu").input[0], "Conv"), f"{sense.name}.conv{number}")
            value = back(value, "AveragePool").input[0]
        else:
            value = weigh(back(back(part, "Relu").input[0], "Gemm"), first)
        if value != sense.name:
            raise ValueError(f"{sense.name} does not come first")
        weights[first] = weights[first] / np.float32(sense.scale)
    if not all(np.isfinite(array).all() for array in weights.values()):
        raise ValueError("weights that are not finite")
    return weights
