"""No file at all."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"offset": "0"}, bytes(20))
