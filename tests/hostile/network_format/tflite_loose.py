"""A network of TensorFlow Lite, named as an ONNX file."""

from tests.hostile.parts import Upload, metadata


def build() -> Upload:
    return [("car.onnx", b"\x28\0\0\0TFL3" + bytes(20)), ("model_metadata.json", metadata())]
