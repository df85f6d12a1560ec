"""A node that reads what comes after it."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network([helper.make_node("Abs", ["later"], ["x"]), helper.make_node("Abs", ["row"], ["later"])]))
