"""An ONNX file above the limit for networks."""

from tests.hostile.parts import Upload, good_network, pair


def build() -> Upload:
    return pair(good_network() + bytes(41 * 1024 * 1024))
