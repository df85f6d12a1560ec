"""An offset with more digits than any file has bytes."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data", "offset": "9" * 900}, bytes(20))
