"""A whole number that is no choice among scores."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network([helper.make_node("Identity", ["row"], ["x"])])
    model.graph.node.append(helper.make_node("Cast", ["row"], ["number"], to=TensorProto.INT64))
    del model.graph.output[:]
    model.graph.output.append(helper.make_tensor_value_info("number", TensorProto.INT64, [1, 1]))
    return pair(model)
