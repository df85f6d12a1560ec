"""A function that calls itself."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    opsets = [helper.make_opsetid("", 17), helper.make_opsetid("f", 1)]
    function = helper.make_function("f", "F", ["a"], ["b"], [helper.make_node("F", ["a"], ["b"], domain="f")], opsets)
    return pair(network([helper.make_node("F", ["row"], ["x"], domain="f")], domains=("f",), functions=[function]))
