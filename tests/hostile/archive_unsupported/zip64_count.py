"""A member count that points to a zip64 record."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    return [("car.zip", zip_by_hand(ZipEntry(b"car.onnx", good_network()), count=0xFFFF))]
