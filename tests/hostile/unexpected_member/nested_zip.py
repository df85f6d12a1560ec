"""A zip in a zip."""

from tests.hostile.parts import Upload, good_network, good_zip, zipped


def build() -> Upload:
    return good_zip(("inner.zip", zipped(("car.onnx", good_network()))))
