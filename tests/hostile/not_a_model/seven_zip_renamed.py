"""Not a network at all: seven zip renamed."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"7z\xbc\xaf\x27\x1c" + bytes(100))
