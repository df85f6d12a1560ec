"""A choice that takes the last of equal scores: the referee takes the first."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    model.graph.node.append(helper.make_node("ArgMax", ["scores"], ["number"], axis=1, select_last_index=1))
    del model.graph.output[:]
    model.graph.output.append(helper.make_tensor_value_info("number", TensorProto.INT64, [1, 1]))
    return pair(model)
