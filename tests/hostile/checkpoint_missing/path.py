"""A checkpoint whose name is a way out of the archive."""

from tests.hostile.parts import Upload, small_car, training_folder

CHECKPOINT = "../../etc/passwd"


def build() -> Upload:
    return training_folder({7: small_car()})
