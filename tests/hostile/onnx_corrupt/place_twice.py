"""Two places for one tensor."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    return outside({"location": "car.onnx.data"}, bytes(20), again={"location": "other.data"})
