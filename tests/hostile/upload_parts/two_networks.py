"""Two networks and no metadata."""

from tests.hostile.parts import Upload, good_network


def build() -> Upload:
    return [("a.onnx", good_network()), ("b.onnx", good_network())]
