"""Two different networks in one archive."""

from tests.hostile.parts import Upload, good_network, good_zip


def build() -> Upload:
    return good_zip(("other.onnx", good_network() + b"\0"))
