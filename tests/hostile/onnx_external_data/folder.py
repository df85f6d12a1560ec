"""A place in a folder beside it."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "weights/car.onnx.data"}, bytes(20))
