"""A checkpoint is asked for of a car that has none."""

from tests.hostile.parts import Upload, car, small_car

CHECKPOINT = "best"


def build() -> Upload:
    return car(small_car())
