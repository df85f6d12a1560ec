"""An ONNX file above the limit for networks."""

from tests.hostile.parts import Upload, good_network, pair

LIMITS = {"model_bytes": 1 << 20}


def build() -> Upload:
    return pair(good_network() + bytes(1 << 20))
