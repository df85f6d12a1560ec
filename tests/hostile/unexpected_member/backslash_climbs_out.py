"""A member that climbs out by backslashes."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("agent\\..\\..\\x.onnx", b"x"))
