"""An operator of the domain ai.onnx.ml."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network([helper.make_node("Scaler", ["row"], ["x"], domain="ai.onnx.ml")], domains=("ai.onnx.ml",)))
