"""One more input than there are sensors."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.input.append(helper.make_tensor_value_info("clock", TensorProto.FLOAT, [1]))
    return pair(model)
