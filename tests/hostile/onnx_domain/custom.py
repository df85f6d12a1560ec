"""An operator of the domain evil.example."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network([helper.make_node("Anything", ["row"], ["x"], domain="evil.example")], domains=("evil.example",))
    )
