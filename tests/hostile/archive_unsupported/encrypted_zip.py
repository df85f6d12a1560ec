"""An encrypted member."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    return [("car.zip", zip_by_hand(ZipEntry(b"car.onnx", good_network(), flags=1)))]
