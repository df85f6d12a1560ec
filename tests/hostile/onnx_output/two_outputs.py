"""Scores and values."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.output.append(helper.make_tensor_value_info("row", TensorProto.FLOAT, [1, 1]))
    return pair(model)
