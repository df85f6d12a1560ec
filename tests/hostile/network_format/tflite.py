"""A network of TensorFlow Lite, in an archive."""

from tests.hostile.parts import Upload, archive, metadata


def build() -> Upload:
    return archive(("car.tflite", b"\x1c\0\0\0TFL3" + bytes(20)), ("model_metadata.json", metadata()))
