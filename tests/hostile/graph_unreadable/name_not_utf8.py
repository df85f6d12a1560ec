"""A node name that is no UTF-8."""

from tests.hostile.parts import Upload, car, field, small_car


def build() -> Upload:
    return car(small_car() + field(1, field(1, b"\xff\xfe") + field(2, "Add")))
