"""Not a network at all: rar renamed."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"Rar!\x1a\x07\x01\x00" + bytes(100))
