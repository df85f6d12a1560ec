"""Bytes between two members that belong to none."""

import struct

from tests.hostile.parts import Upload, ZipEntry, good_network, metadata


def build() -> Upload:
    first, second = ZipEntry(b"car.onnx", good_network()), ZipEntry(b"model_metadata.json", metadata())
    body = first.local() + b"hidden" + second.local()
    directory = first.central(0) + second.central(len(first.local()) + 6)
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 2, 2, len(directory), len(body), 0)
    return [("car.zip", body + directory + end)]
