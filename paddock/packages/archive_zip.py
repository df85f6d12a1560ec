"""A strict reader of zip archives."""

# The standard library accepts overlapping entries, reads a central directory of any length and lets the last of two
# equal names win. Accepted here is what ordinary tools write: entries one after the other, STORED or DEFLATED, no
# encryption, the central directory behind them and nothing before or after; of zip64 the local headers that streaming
# tools and torch write for files of any size. The archive stays where it is, and only requested members are read.
# Format: PKWARE APPNOTE.TXT 6.3.

import io
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import BinaryIO

from paddock.errors import UserFault

from .compressed import read_exactly
from .limits import PackageLimits
from .members import Catalogue

_END = struct.Struct("<4s4H2LH")
_ENTRY = struct.Struct("<4s6H3L5H2L")
_LOCAL = struct.Struct("<4s5H3L2H")
_STORED, _DEFLATED = 0, 8
_ENCRYPTED, _DESCRIPTOR, _STRONG, _MASKED = 0x1, 0x8, 0x40, 0x2000
_TYPE_MASK = 0o170000
_REGULAR = 0o100000
_WIDE = 0xFFFFFFFF  # stands for a size that is in the zip64 field
_ZIP64 = 1
_CHUNK = 256 * 1024


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


class ZipArchive:
    """A zip in a seekable stream. ``sizes``: its files by clean name. Raises UserFault for all out of the ordinary."""

    def __init__(self, stream: BinaryIO, limits: PackageLimits) -> None:
        self._stream = stream
        self._length = stream.seek(0, io.SEEK_END)
        self._name_limit = limits.member_name_bytes + 1  # of a longer name, enough to refuse it
        self._entries: dict[str, _Entry] = {}
        catalogue = Catalogue(limits)
        entries, directory = self._directory(limits)
        self._refuse_overlap(entries, directory)
        total = 0
        for entry in entries:
            if entry.name.endswith((b"/", b"\\")):
                catalogue.folder(entry.name)
                if entry.size or entry.packed > 2:
                    raise UserFault("archive_corrupt")
                continue
            if entry.mode & _TYPE_MASK not in (0, _REGULAR):
                raise UserFault("unexpected_member", member="a link or device")
            name = catalogue.file(entry.name, entry.size, partial(self._has_sum, entry.crc))
            total += entry.size
            allowed = max(limits.expansion_free_bytes, limits.expansion_ratio * entry.packed)
            if total > limits.expanded_bytes or entry.size > allowed:
                raise UserFault("expanded_size")
            if name is not None:
                self._entries[name] = entry
        self.sizes = catalogue.sizes

    def read(self, names: Iterable[str]) -> dict[str, bytes]:
        """The content of these files, each checked by its length and checksum."""
        return {name: self._inflate(self._entries[name]) for name in names}

    def _has_sum(self, crc: int, name: str) -> bool:
        return self._entries[name].crc == crc

    def _at(self, offset: int, size: int) -> bytes:
        """``size`` bytes from ``offset`` on, or fewer at the end."""
        self._stream.seek(offset)
        return read_exactly(self._stream, size)

    def _directory(self, limits: PackageLimits) -> tuple[list[_Entry], int]:
        """All entries in file order, and the offset of the central directory."""
        start, end_record = self._end_record()
        _, disk, first_disk, here, count, size, offset, _comment = end_record
        if 0xFFFF in (here, count) or _WIDE in (size, offset) or disk or first_disk or here != count:
            raise UserFault("archive_unsupported")
        if count > limits.archive_members:
            raise UserFault("too_many_members", limit=limits.archive_members)
        if offset + size != start:
            raise UserFault("archive_corrupt")
        entries, at = [], offset
        for _index in range(count):
            if at + _ENTRY.size > start:
                raise UserFault("archive_corrupt")
            record = self._at(at, _ENTRY.size + self._name_limit)
            (sign, _made, _need, flags, method, _time, _date, crc, packed, full, names, extras, comments, _disk,
             _internal, external, local) = _ENTRY.unpack_from(record)  # fmt: skip
            end = at + _ENTRY.size + names + extras + comments
            if sign != b"PK\x01\x02" or end > start:
                raise UserFault("archive_corrupt")
            known = method in (_STORED, _DEFLATED) and not flags & (_ENCRYPTED | _STRONG | _MASKED)
            if not known or _WIDE in (packed, full, local):
                raise UserFault("archive_unsupported")
            if method == _STORED and packed != full:
                raise UserFault("archive_corrupt")
            name = record[_ENTRY.size : _ENTRY.size + names]
            entries.append(_Entry(name, flags, method, crc, packed, full, external >> 16, local))
            at = end
        if at != start:
            raise UserFault("archive_corrupt")
        return sorted(entries, key=lambda entry: entry.offset), offset

    def _end_record(self) -> tuple[int, tuple]:
        """The position and the content of the end record, which must close the file exactly."""
        first = max(0, self._length - _END.size - 0xFFFF)
        tail = self._at(first, self._length - first)
        at = tail.rfind(b"PK\x05\x06")
        while at >= 0:
            if at + _END.size <= len(tail):
                record = _END.unpack_from(tail, at)
                if at + _END.size + record[-1] == len(tail):
                    return first + at, record
            at = tail.rfind(b"PK\x05\x06", 0, at)
        raise UserFault("archive_corrupt")

    def _refuse_overlap(self, entries: list[_Entry], directory: int) -> None:
        """Every entry must begin where the one before ends (a data descriptor may stand between)."""
        at = 0
        for entry in entries:
            if entry.offset < at:
                raise UserFault("archive_overlap")
            if entry.offset != at:
                raise UserFault("archive_corrupt")
            start, is_wide = self._data_start(entry, directory)
            at = start + entry.packed
            if at > directory:
                raise UserFault("archive_overlap")
            if entry.flags & _DESCRIPTOR:
                at += self._descriptor_size(at, entry, is_wide)
        if at > directory:
            raise UserFault("archive_overlap")
        if at != directory:
            raise UserFault("archive_corrupt")

    def _descriptor_size(self, at: int, entry: _Entry, is_wide: bool) -> int:
        """Bytes of the data descriptor: its signature is optional, its sizes have 4 bytes or, in zip64, 8."""
        found = self._at(at, 24)
        signature = 4 if found[:4] == b"PK\x07\x08" else 0
        wide = struct.pack("<LQQ", entry.crc, entry.packed, entry.size)
        if is_wide and found[signature : signature + len(wide)] == wide:
            return signature + len(wide)
        return signature + 12

    def _data_start(self, entry: _Entry, directory: int) -> tuple[int, bool]:
        """Offset of the entry's data, and whether its local header is of zip64; it must agree with the directory."""
        if entry.offset + _LOCAL.size > directory:
            raise UserFault("archive_corrupt")
        header = self._at(entry.offset, _LOCAL.size)
        sign, _need, flags, method, _time, _date, crc, packed, size, names, extras = _LOCAL.unpack(header)
        name_at = entry.offset + _LOCAL.size
        name = self._at(name_at, min(names, self._name_limit))
        if sign != b"PK\x03\x04" or method != entry.method or name != entry.name or flags & _ENCRYPTED:
            raise UserFault("archive_corrupt")
        wide = _wide_sizes(self._at(name_at + names, extras))
        if wide is not None:
            size = wide[0] if size == _WIDE else size
            packed = wide[1] if packed == _WIDE else packed
        agrees = flags & _DESCRIPTOR or (crc, packed, size) == (entry.crc, entry.packed, entry.size)
        if not agrees or (flags ^ entry.flags) & _DESCRIPTOR:
            raise UserFault("archive_corrupt")
        return name_at + names + extras, wide is not None

    def _inflate(self, entry: _Entry) -> bytes:
        """The member's bytes, never more than its stated size, checked by length and CRC."""
        names, extras = _LOCAL.unpack(self._at(entry.offset, _LOCAL.size))[-2:]
        start = entry.offset + _LOCAL.size + names + extras
        content = self._at(start, entry.packed) if entry.method == _STORED else self._inflated(start, entry)
        if len(content) != entry.size or zlib.crc32(content) != entry.crc:
            raise UserFault("archive_corrupt")
        return content

    def _inflated(self, start: int, entry: _Entry) -> bytes:
        engine = zlib.decompressobj(-zlib.MAX_WBITS)
        content, packed = io.BytesIO(), 0
        while packed < entry.packed and not engine.eof:
            chunk = self._at(start + packed, min(_CHUNK, entry.packed - packed))
            packed += len(chunk)
            try:
                content.write(engine.decompress(chunk, entry.size + 1 - content.tell()))
            except zlib.error as error:
                raise UserFault("archive_corrupt") from error
            if content.tell() > entry.size:
                raise UserFault("expanded_size")
            if engine.unconsumed_tail or not chunk:
                raise UserFault("archive_corrupt")
        if not engine.eof or engine.unused_data or packed != entry.packed:
            raise UserFault("archive_corrupt")
        return content.getvalue()


def _wide_sizes(extra: bytes) -> tuple[int, int] | None:
    """Size and packed size out of a local header's zip64 field; None without one."""
    at = 0
    while at + 4 <= len(extra):
        kind, size = struct.unpack_from("<HH", extra, at)
        if kind == _ZIP64 and size >= 16 and at + 20 <= len(extra):
            return struct.unpack_from("<QQ", extra, at + 4)
        at += 4 + size
    return None
