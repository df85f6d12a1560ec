"""No JSON at all."""

from tests.hostile.parts import Upload, small_car, training_folder


def build() -> Upload:
    return training_folder({7: small_car()}, b"13_Step-25173.ckpt")
