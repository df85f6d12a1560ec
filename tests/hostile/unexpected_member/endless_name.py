"""A member name of three hundred letters."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("a" * 300 + ".onnx", b"x"))
