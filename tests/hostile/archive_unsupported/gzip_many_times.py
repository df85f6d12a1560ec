"""A car's archive in five layers of gzip."""

from tests.hostile.parts import Upload, car, gzip, small_car


def build() -> Upload:
    ((name, content),) = car(small_car())
    return [(name, gzip(gzip(gzip(gzip(content)))))]
