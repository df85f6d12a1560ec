"""A member whose two headers give different names."""

from tests.hostile.parts import Upload, ZipEntry, good_network, zip_by_hand


def build() -> Upload:
    entry = ZipEntry(b"car.onnx", good_network())
    content = zip_by_hand(entry)
    return [("car.zip", content.replace(b"car.onnx", b"bus.onnx", 1))]
