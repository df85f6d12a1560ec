"""A place that is the folder."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": ".."}, bytes(20))
