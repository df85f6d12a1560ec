"""Thirty-four doublings of one value."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    nodes = [helper.make_node("Concat", ["row", "row"], ["v0"], axis=1)]
    nodes += [helper.make_node("Concat", [f"v{n}", f"v{n}"], [f"v{n + 1}"], axis=1) for n in range(33)]
    nodes += [helper.make_node("ReduceMean", ["v33"], ["x"], axes=[1])]
    return pair(network(nodes))
