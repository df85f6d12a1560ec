"""An archive and one more file."""

from tests.hostile.parts import Upload, car, metadata, small_car


def build() -> Upload:
    return [*car(small_car()), ("model_metadata.json", metadata())]
