"""A length that never ends."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    return car(small_car() + b"\x0a" + b"\xff" * 100)
