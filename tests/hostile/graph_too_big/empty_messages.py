"""Half a million fields of two bytes in one node."""

from tests.hostile.parts import Upload, car, field, small_car


def build() -> Upload:
    return car(small_car() + field(1, field(1, "n") + field(2, "NoOp") + field(3, b"") * 500_000))
