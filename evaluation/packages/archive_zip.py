"""A strict zip reader for two small files. Our own, because the standard library trusts what it should not: it takes
overlapping entries, reads a central directory of any length and lets the last of two equal names win.

Accepted is what ordinary tools write: entries one after the other, STORED or DEFLATED, no encryption, no zip64,
the central directory behind them and nothing before or after. Format: PKWARE APPNOTE.TXT 6.3.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from faults import UserFault

from .limits import PackageLimits
from .members import SKIP, Expected

_END = struct.Struct("<4s4H2LH")
_ENTRY = struct.Struct("<4s6H3L5H2L")
_LOCAL = struct.Struct("<4s5H3L2H")
_STORED, _DEFLATED = 0, 8
_ENCRYPTED, _DESCRIPTOR, _STRONG, _MASKED = 0x1, 0x8, 0x40, 0x2000
_TYPE_MASK = 0o170000
_REGULAR = 0o100000


@dataclass(frozen=True)
class _Entry:
    name: bytes
    flags: int
    method: int
    crc: int
    packed: int
    size: int
    mode: int
    offset: int


def read_zip(data: bytes, limits: PackageLimits) -> dict[str, bytes]:
    """The wanted members of a zip held in memory: ``{role: bytes}`` with the roles of :mod:`.members`.

    Raises UserFault for everything out of the ordinary; nothing is written to disk.
    """
    view = memoryview(data)
    entries, directory = _directory(view, limits)
    _refuse_overlap(view, entries, directory)
    expected = Expected(limits)
    found: dict[str, bytes] = {}
    total = 0
    for entry in entries:
        if entry.name.endswith(b"/"):
            expected.folder(entry.name)
            if entry.size or entry.packed > 2:
                raise UserFault("archive_corrupt")
            continue
        if entry.mode & _TYPE_MASK not in (0, _REGULAR):
            raise UserFault("unexpected_member", member="a link or device")
        role = expected.file(entry.name)
        total += entry.size
        if total > limits.expanded_bytes or _ratio_exceeded(entry, limits):
            raise UserFault("expanded_size")
        if role != SKIP:
            found[role] = _inflate(view, entry)
    return found


def _ratio_exceeded(entry: _Entry, limits: PackageLimits) -> bool:
    return entry.size > max(limits.expansion_free_bytes, limits.expansion_ratio * entry.packed)


def _directory(view: memoryview, limits: PackageLimits) -> tuple[list[_Entry], int]:
    """All entries in file order, and the offset of the central directory."""
    start = _end_record(view)
    _, disk, first_disk, here, count, size, offset, _comment = _END.unpack_from(view, start)
    if 0xFFFF in (here, count) or 0xFFFFFFFF in (size, offset):
        raise UserFault("archive_unsupported")
    if disk or first_disk or here != count:
        raise UserFault("archive_unsupported")
    if count > limits.archive_members:
        raise UserFault("too_many_members", limit=limits.archive_members)
    if offset + size != start:
        raise UserFault("archive_corrupt")
    entries, at = [], offset
    for _index in range(count):
        if at + _ENTRY.size > start:
            raise UserFault("archive_corrupt")
        (sign, _made, _need, flags, method, _time, _date, crc, packed, full, names, extras, comments, _disk, _internal,
         external, local) = _ENTRY.unpack_from(view, at)  # fmt: skip
        end = at + _ENTRY.size + names + extras + comments
        if sign != b"PK\x01\x02" or end > start:
            raise UserFault("archive_corrupt")
        if 0xFFFFFFFF in (packed, full, local) or flags & (_ENCRYPTED | _STRONG | _MASKED):
            raise UserFault("archive_unsupported")
        if method not in (_STORED, _DEFLATED):
            raise UserFault("archive_unsupported")
        if method == _STORED and packed != full:
            raise UserFault("archive_corrupt")
        name = bytes(view[at + _ENTRY.size : at + _ENTRY.size + names])
        entries.append(_Entry(name, flags, method, crc, packed, full, external >> 16, local))
        at = end
    if at != start:
        raise UserFault("archive_corrupt")
    return sorted(entries, key=lambda entry: entry.offset), offset


def _end_record(view: memoryview) -> int:
    """Where the end record stands; it must close the file exactly."""
    tail = bytes(view[max(0, len(view) - _END.size - 0xFFFF) :])
    at = tail.rfind(b"PK\x05\x06")
    while at >= 0:
        if at + _END.size <= len(tail):
            comment = _END.unpack_from(tail, at)[-1]
            if at + _END.size + comment == len(tail):
                return len(view) - len(tail) + at
        at = tail.rfind(b"PK\x05\x06", 0, at)
    raise UserFault("archive_corrupt")


def _refuse_overlap(view: memoryview, entries: list[_Entry], directory: int) -> None:
    """Every entry must begin where the one before ends (a data descriptor may stand between)."""
    at = 0
    for entry in entries:
        if entry.offset < at:
            raise UserFault("archive_overlap")
        if entry.offset != at:
            raise UserFault("archive_corrupt")
        start = _data_start(view, entry, directory)
        at = start + entry.packed
        if at > directory:
            raise UserFault("archive_overlap")
        if entry.flags & _DESCRIPTOR:
            at += 16 if bytes(view[at : at + 4]) == b"PK\x07\x08" else 12
    if at > directory:
        raise UserFault("archive_overlap")
    if at != directory:
        raise UserFault("archive_corrupt")


def _data_start(view: memoryview, entry: _Entry, directory: int) -> int:
    """Offset of the entry's data; its local header must agree with the central directory."""
    if entry.offset + _LOCAL.size > directory:
        raise UserFault("archive_corrupt")
    sign, _need, flags, method, _time, _date, crc, packed, size, names, extras = _LOCAL.unpack_from(view, entry.offset)
    name_at = entry.offset + _LOCAL.size
    name = bytes(view[name_at : name_at + names])
    if sign != b"PK\x03\x04" or method != entry.method or name != entry.name or flags & _ENCRYPTED:
        raise UserFault("archive_corrupt")
    if not flags & _DESCRIPTOR and (crc, packed, size) != (entry.crc, entry.packed, entry.size):
        raise UserFault("archive_corrupt")
    if (flags ^ entry.flags) & _DESCRIPTOR:
        raise UserFault("archive_corrupt")
    return name_at + names + extras


def _inflate(view: memoryview, entry: _Entry) -> bytes:
    """The member's bytes, never more than its stated size, checked by length and CRC."""
    sign_to_extra = _LOCAL.unpack_from(view, entry.offset)
    start = entry.offset + _LOCAL.size + sign_to_extra[-2] + sign_to_extra[-1]
    packed = view[start : start + entry.packed]
    if entry.method == _STORED:
        content = bytes(packed)
    else:
        engine = zlib.decompressobj(-zlib.MAX_WBITS)
        try:
            content = engine.decompress(packed, entry.size + 1)
        except zlib.error as error:
            raise UserFault("archive_corrupt") from error
        if not engine.eof and len(content) > entry.size:
            raise UserFault("expanded_size")
        if not engine.eof or engine.unused_data:
            raise UserFault("archive_corrupt")
    if len(content) != entry.size or zlib.crc32(content) != entry.crc:
        raise UserFault("archive_corrupt")
    return content
