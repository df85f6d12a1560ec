"""A checkpoint is asked for that the folder does not hold."""

from tests.hostile.parts import Upload, small_car, training_folder

CHECKPOINT = "3"


def build() -> Upload:
    return training_folder({7: small_car()})
