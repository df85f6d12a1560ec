"""A member that reaches into the next one."""

import zlib

from tests.hostile.parts import Upload, ZipEntry, good_network, metadata, zip_by_hand


def build() -> Upload:
    second = ZipEntry(b"model_metadata.json", metadata())
    first = ZipEntry(b"car.onnx", good_network())
    first.data += second.local()
    first.packed = first.size = len(first.data)
    first.crc = zlib.crc32(first.data)
    inner = ZipEntry(b"model_metadata.json", metadata(), offset=len(first.local()) - len(second.local()))
    return [("car.zip", zip_by_hand(first, inner))]
