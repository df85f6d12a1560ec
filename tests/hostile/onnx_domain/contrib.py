"""An operator of the domain com.microsoft."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(network([helper.make_node("Gelu", ["row"], ["x"], domain="com.microsoft")], domains=("com.microsoft",)))
