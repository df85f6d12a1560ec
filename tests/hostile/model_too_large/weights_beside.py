"""A small network whose file of weights is above the limit."""

from tests.hostile.parts import Upload, outside

LIMITS = {"model_bytes": 1 << 20}


def build() -> Upload:
    return outside({"location": "car.onnx.data"}, bytes(1 << 20))
