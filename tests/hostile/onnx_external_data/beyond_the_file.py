"""A place that begins within the file beside it and ends behind it."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data", "offset": "8", "length": "20"}, bytes(20))
