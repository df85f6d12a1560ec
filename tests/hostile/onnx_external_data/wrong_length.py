"""A length that is not that of the weights."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data", "length": "8"}, bytes(20))
