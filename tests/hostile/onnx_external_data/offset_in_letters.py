"""An offset in digits of another script."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data", "offset": "\u0663"}, bytes(20))
