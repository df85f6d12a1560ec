"""Not a network at all: javascript."""

from tests.hostile.parts import Upload, pair


def build() -> Upload:
    return pair(b"fetch('//evil.example')")
