"""A list in place of the name."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, b'{"best_checkpoint": {"name": ["13_Step-1.ckpt"]}}')
