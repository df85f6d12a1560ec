"""A training folder without metadata."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, metadata_json=None)
