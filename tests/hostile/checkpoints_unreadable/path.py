"""The best checkpoint is a path."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, b'{"best_checkpoint": {"name": "../../../etc/13_Step-25173.ckpt"}}')
