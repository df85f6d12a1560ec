"""A graph as an attribute of an activation."""

from onnx import helper

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Relu", ["row"], None, body=helper.make_graph([], "g", [], []))
