"""Weights beside it, under another name."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "elsewhere.data"}, bytes(20))
