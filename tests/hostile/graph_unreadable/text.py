"""Text that begins as a graph would."""

from tests.hostile.parts import Upload, car


def build() -> Upload:
    return car(b"\n\x00" + b"import os" * 100)
