"""A convolution of nothing."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network([helper.make_node("Conv", [], ["x"])]))
