"""Two cars' archives in a zip."""

from tests.hostile.parts import Upload, car, small_car, zipped


def build() -> Upload:
    ((_, content),) = car(small_car())
    return [("cars.zip", zipped(("one.tar.gz", content), ("two.tar.gz", content + bytes(1))))]
