"""An attribute that refers to a function's."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    node = helper.make_node("Softmax", ["row"], ["x"], axis=0)
    node.attribute[0].ClearField("i")
    node.attribute[0].ref_attr_name = "axis"
    return pair(network([node]))
