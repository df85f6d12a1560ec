"""Two nodes that make the same value."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network([helper.make_node("Abs", ["row"], ["x"]), helper.make_node("Neg", ["row"], ["x"])]))
