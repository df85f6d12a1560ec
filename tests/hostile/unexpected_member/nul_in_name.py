"""A member name with a zero byte."""

from tests.hostile.parts import Upload, ZipEntry, good_network, metadata, zip_by_hand


def build() -> Upload:
    entry = ZipEntry(b"a\0b.onnx", good_network())
    return [("car.zip", zip_by_hand(entry, ZipEntry(b"model_metadata.json", metadata())))]
