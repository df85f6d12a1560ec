"""A graph that broke off."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    return car(small_car()[:-9])
