"""Two that fit, whose names are tricks."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    names = "<script>\x1b[31m", "\u202egnp"
    model.graph.node.extend(helper.make_node("Neg", ["scores"], [name]) for name in names)
    del model.graph.output[:]
    model.graph.output.extend(helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 5]) for name in names)
    return pair(model)
