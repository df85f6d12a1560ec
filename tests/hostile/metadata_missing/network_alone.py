"""A network without metadata."""

from tests.hostile.parts import Upload, good_network


def build() -> Upload:
    return [("car.onnx", good_network())]
