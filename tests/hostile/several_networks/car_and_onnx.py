"""A car of the console and an ONNX network in one archive."""

from tests.hostile.parts import Upload, good_zip, small_car


def build() -> Upload:
    return good_zip(("agent/model.pb", small_car()))
