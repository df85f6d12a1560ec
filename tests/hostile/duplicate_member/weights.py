"""Two different files of weights whose names differ in letters' case only."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("car.onnx.data", bytes(20)), ("CAR.onnx.data", bytes(19) + b"\1"))
