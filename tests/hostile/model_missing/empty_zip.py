"""A zip without members."""

from tests.hostile.parts import Upload, zipped


def build() -> Upload:
    return [("car.zip", zipped())]
