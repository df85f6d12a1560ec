"""Two files that are small enough only one by one."""

from tests.hostile.parts import Upload

LIMITS = {"upload_bytes": 4 << 20}


def build() -> Upload:
    half = 2 << 20
    return [("car.onnx", b"\x08" + bytes(half)), ("car.onnx.data", bytes(half))]
