"""Not a network at all: pdf."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"%PDF-1.7\n" + bytes(100))
