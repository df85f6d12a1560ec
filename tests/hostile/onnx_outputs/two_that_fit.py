"""Two outputs of the same shape, and no name that says which one drives."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.output[0].name = "a"
    model.graph.node[-1].output[0] = "a"
    model.graph.node.append(helper.make_node("Neg", ["a"], ["b"]))
    model.graph.output.append(helper.make_tensor_value_info("b", TensorProto.FLOAT, [1, 5]))
    return pair(model)
