"""Sixty thousand empty members."""

import struct

from tests.hostile.parts import Upload, ZipEntry


def build() -> Upload:
    entry = ZipEntry(b"a", b"")
    directory = entry.central(0) * 60_000
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 60_000, 60_000, len(directory), len(entry.local()), 0)
    return [("car.zip", entry.local() + directory + end)]
