"""A path as Windows writes it."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "..\\car.onnx.data"}, bytes(20))
