"""A member that says it is longer than it is."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    return [("car.zip", zip_by_hand(ZipEntry(b"car.onnx", good_network(), method=8, size=1_000_000)))]
