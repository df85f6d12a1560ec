"""Not a network at all: ort format."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"\x1c\x00\x00\x00ORTM" + bytes(200))
