"""The best checkpoint is asked for where nothing says which one that is."""

from tests.hostile.parts import Upload, small_car, training_folder

CHECKPOINT = "best"


def build() -> Upload:
    return training_folder({7: small_car()})
