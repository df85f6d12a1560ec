"""A network of Keras."""

from tests.hostile.parts import Upload, metadata


def build() -> Upload:
    return [("car.h5", b"\x89HDF\r\n\x1a\n" + bytes(20)), ("model_metadata.json", metadata())]
