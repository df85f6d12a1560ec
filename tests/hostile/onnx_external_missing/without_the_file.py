"""The .onnx file without the .onnx.data file that torch wrote beside it."""

from tests.hostile.parts import Upload, outside


def build() -> Upload:
    network, _weights, metadata = outside({"location": "car.onnx.data"}, bytes(20))
    return [network, metadata]
