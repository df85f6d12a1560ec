"""A member whose name is a trick."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("a\x1b[31m.onnx", b"x"))
