"""A file beside it that holds fewer numbers than the weights have."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data"}, bytes(16))
