"""A thousand to one."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("other.onnx", bytes(70 * 1024 * 1024)))
