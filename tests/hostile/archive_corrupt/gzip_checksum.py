"""A car's archive with a wrong checksum at its end."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    ((name, content),) = car(small_car())
    return [(name, content[:-8] + bytes(8))]
