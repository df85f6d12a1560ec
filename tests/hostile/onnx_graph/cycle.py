"""Two nodes that read each other."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [
                helper.make_node("Add", ["row", "b"], ["a"]),
                helper.make_node("Abs", ["a"], ["b"]),
                helper.make_node("Abs", ["b"], ["x"]),
            ]
        )
    )
