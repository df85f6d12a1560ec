"""Not a network at all: windows program."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"MZ\x90\x00" + bytes(100))
