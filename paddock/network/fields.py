"""Fields of the protobuf wire format, written; :mod:`.wire` reads them. Format: protobuf.dev, "Encoding"."""

from __future__ import annotations

import struct

VARINT, BYTES, FIXED32 = 0, 2, 5


def message(place: int, content: bytes) -> bytes:
    """A nested message, or bytes."""
    return key(place, BYTES) + varint(len(content)) + content


def text(place: int, value: str) -> bytes:
    """A string."""
    return message(place, value.encode())


def number(place: int, value: int) -> bytes:
    """A whole number or a truth value; negative ones in two's complement."""
    return key(place, VARINT) + varint(value & (1 << 64) - 1)


def real(place: int, value: float) -> bytes:
    """A 32-bit float."""
    return key(place, FIXED32) + struct.pack("<f", value)


def key(place: int, kind: int) -> bytes:
    """What stands before a field: its number, and the kind of its value."""
    return varint(place << 3 | kind)


def varint(value: int) -> bytes:
    """A whole number of at least 0, seven bits a byte."""
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)
