"""Not a network at all: png."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"\x89PNG\r\n\x1a\n" + bytes(100))
