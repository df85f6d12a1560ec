"""A shape that depends on what the camera sees."""

from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    nodes = [
        helper.make_node("Cast", ["mean"], ["s"], to=TensorProto.INT64),
        helper.make_node("Concat", ["s", "s"], ["shape"], axis=0),
        helper.make_node("Reshape", ["row", "shape"], ["x"]),
    ]
    return pair(network(nodes))
