"""A local zip64 field that says another size than the directory."""

import struct

from tests.hostile.parts import Upload, ZipEntry, good_network, metadata, zip_by_hand


def build() -> Upload:
    entry = ZipEntry(b"car.onnx", good_network(), wide=struct.pack("<QQ", 5, 5))
    return [("car.zip", zip_by_hand(entry, ZipEntry(b"model_metadata.json", metadata())))]
