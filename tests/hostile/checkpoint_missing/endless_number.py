"""A checkpoint with more digits than a number may have."""

from tests.hostile.parts import Upload, small_car, training_folder

CHECKPOINT = "9" * 5_000


def build() -> Upload:
    return training_folder({7: small_car()})
