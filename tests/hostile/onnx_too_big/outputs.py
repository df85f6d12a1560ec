"""Outputs without end, each of which would be tried."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    for number in range(100):
        model.graph.node.append(helper.make_node("Neg", ["scores"], [f"s{number}"]))
        model.graph.output.append(helper.make_tensor_value_info(f"s{number}", TensorProto.FLOAT, [1, 5]))
    return pair(model)
