"""A car's archive that broke off."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    ((name, content),) = car(small_car())
    return [(name, content[: len(content) // 2])]
