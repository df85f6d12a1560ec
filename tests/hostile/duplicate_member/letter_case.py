"""Two names that differ in letters' case only."""

from tests.hostile.parts import Upload, good_zip


def build() -> Upload:
    return good_zip(("Car.ONNX", b"x"))
