"""A zip archive that is sent while it is written (APPNOTE.TXT 6.3). Stored gzip streams are passed on without
recompression."""

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

_LOCAL, _CENTRAL, _END = 0x04034B50, 0x02014B50, 0x06054B50
_VERSION, _NAMES_ARE_UTF8, _DEFLATED = 20, 0x800, 8
_DAY = 1 << 5 | 1  # 1980-01-01, the first there is: the same training gives the same bytes
_PLAIN_GZIP = b"\x1f\x8b\x08\x00"
_GZIP_HEAD, _GZIP_TAIL = 10, 8


@dataclass(frozen=True)
class ZipPart:
    """One file of a zip: its name, and its content deflated, with the CRC-32 and the length of what it unpacks to."""

    name: str
    deflated: bytes
    crc: int
    length: int


def part_of(name: str, content: Iterable[bytes]) -> ZipPart:
    """A file of the zip from its content in pieces; only what they are deflated to is held."""
    packing = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
    crc = length = 0
    packed = []
    for piece in content:
        crc, length = zlib.crc32(piece, crc), length + len(piece)
        packed.append(packing.compress(piece))
    return ZipPart(name, b"".join((*packed, packing.flush())), crc, length)


def part_of_gzip(name: str, packed: bytes) -> ZipPart:
    """A file of the zip from a gzip of one member, not unpacked where its head is plain, as Python writes it."""
    if not packed.startswith(_PLAIN_GZIP):
        return part_of(name, [zlib.decompress(packed, wbits=31)])
    crc, length = struct.unpack("<II", packed[-_GZIP_TAIL:])
    return ZipPart(name, packed[_GZIP_HEAD:-_GZIP_TAIL], crc, length)


def zipped(parts: Iterable[ZipPart]) -> Iterator[bytes]:
    """The zip, piece by piece; of ``parts`` one at a time is held."""
    index, at = [], 0
    for part in parts:
        name = part.name.encode()
        about = struct.pack(
            *("<HHHHHIIIHH", _VERSION, _NAMES_ARE_UTF8, _DEFLATED, 0, _DAY),
            *(part.crc, len(part.deflated), part.length, len(name), 0),
        )
        index.append(struct.pack("<IH", _CENTRAL, _VERSION) + about + struct.pack("<HHHII", 0, 0, 0, 0, at) + name)
        head = struct.pack("<I", _LOCAL) + about + name
        yield head + part.deflated
        at += len(head) + len(part.deflated)
    listed = b"".join(index)
    yield listed + struct.pack("<IHHHHIIH", _END, 0, 0, len(index), len(index), len(listed), at, 0)
