"""A frozen graph with weights beside it, which it cannot have."""

from tests.hostile.parts import Upload, metadata, small_car


def build() -> Upload:
    return [("car.pb", small_car()), ("car.data", bytes(8)), ("model_metadata.json", metadata())]
