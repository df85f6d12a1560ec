"""Two files that are small enough only one by one."""

from tests.hostile.parts import Upload


def build() -> Upload:
    half = 33 * 1024 * 1024
    return [("car.onnx", b"\x08" + bytes(half)), ("model_metadata.json", b"{" + b" " * half)]
