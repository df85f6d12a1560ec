"""A second member of gzip with a wrong checksum."""

from tests.hostile.parts import Upload, car, gzip, small_car


def build() -> Upload:
    ((name, content),) = car(small_car())
    return [(name, content + gzip(bytes(10))[:-8] + bytes(8))]
