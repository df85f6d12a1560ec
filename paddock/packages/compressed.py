"""Decompresses streams piece by piece, within one limit of size and ratio."""

# Supported: gzip of any number of members (RFC 1952; bgzip and pigz write many), xz of any number of streams, and
# bzip2, also one inside another.

import bz2
import lzma
import zlib
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any, Protocol

from paddock.errors import UserFault

from . import kinds
from .limits import PackageLimits

CHUNK = 64 * 1024
_LAYERS = 3  # how often a file may be compressed
_MEMBERS = 65_536  # each costs a few microseconds, however little is in it
_XZ_MEMORY = 160 << 20  # of its dictionary; xz -9 asks for 64 MB
_ENGINES: dict[str, tuple[bytes, Callable[[], Any]]] = {
    kinds.GZIP: (b"\x1f\x8b", lambda: zlib.decompressobj(16 + zlib.MAX_WBITS)),
    kinds.XZ: (b"\xfd7zXZ\0", lambda: lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=_XZ_MEMORY)),
    kinds.BZIP2: (b"BZh", bz2.BZ2Decompressor),
}


class Readable(Protocol):
    """Something that gives its bytes in order."""

    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes, none at the end."""


class Unpacked:
    """The innermost stream: ``kind`` is what it holds (a word of :mod:`.kinds`), ``chunks`` its bytes.

    ``head``: what was already read of ``stream``. Raises UserFault ``archive_corrupt``, ``archive_unsupported`` and
    ``expanded_size``, here and while the chunks are read.
    """

    def __init__(self, head: bytes, stream: Readable, limits: PackageLimits) -> None:
        self._limits = limits
        self._packed = 0  # bytes of the upload itself: the ratio of every layer is measured against them
        chunks = self._source(head, stream)
        for _ in range(_LAYERS + 1):
            first, chunks = _peek(chunks)
            self.kind = kinds.sniff(first)
            if self.kind not in kinds.COMPRESSED:
                self.head, self.chunks = first, chunks
                return
            chunks = self._layer(self.kind, chunks)
        raise UserFault("archive_unsupported")

    def _source(self, head: bytes, stream: Readable) -> Iterator[bytes]:
        chunk = head
        while chunk:
            self._packed += len(chunk)
            if self._packed > self._limits.expanded_bytes:
                raise UserFault("expanded_size")
            yield chunk
            chunk = stream.read(CHUNK)

    def _layer(self, kind: str, chunks: Iterator[bytes]) -> Iterator[bytes]:
        """The unpacked bytes of all members. Zeros may stand between and behind them, nothing else."""
        magic, make = _ENGINES[kind]
        engine: Any = None
        rest, members, unpacked = b"", 0, 0
        for chunk in chunks:
            rest += chunk
            while rest:
                if engine is None:
                    rest = rest.lstrip(b"\0")
                    if len(rest) < len(magic) and magic.startswith(rest):
                        break
                    members += 1
                    if not rest.startswith(magic) or members > _MEMBERS:
                        raise UserFault("archive_corrupt")
                    engine = make()
                for piece in _pieces(engine, rest):
                    unpacked += len(piece)
                    allowed = max(self._limits.expansion_free_bytes, self._limits.expansion_ratio * self._packed)
                    if unpacked > min(self._limits.expanded_bytes, allowed):
                        raise UserFault("expanded_size")
                    yield piece
                rest = engine.unused_data if engine.eof else b""
                engine = None if engine.eof else engine
        if engine is not None or rest or not members:
            raise UserFault("archive_corrupt")


def _pieces(engine: Any, data: bytes) -> Iterator[bytes]:
    """The output of a decompressor for this input, in pieces of bounded size."""
    while not engine.eof:
        try:
            piece = engine.decompress(data, CHUNK)
        except (zlib.error, lzma.LZMAError, OSError, ValueError, EOFError) as error:
            if "emory" in str(error):
                raise UserFault("archive_unsupported") from error
            raise UserFault("archive_corrupt") from error
        data = getattr(engine, "unconsumed_tail", b"")  # zlib gives back what it did not take; the others keep it
        if piece:
            yield piece
        elif not data:
            return


def _peek(chunks: Iterator[bytes]) -> tuple[bytes, Iterator[bytes]]:
    """The first bytes, and an iterator over all of them."""
    first = b""
    for chunk in chunks:
        first += chunk
        if len(first) >= kinds.HEAD:
            break
    return first[: kinds.HEAD], chain([first] if first else [], chunks)


def read_exactly(stream: Readable, size: int) -> bytes:
    """``size`` bytes, or fewer at the end of the stream."""
    parts, missing = [], size
    while missing and (part := stream.read(missing)):
        parts.append(part)
        missing -= len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)
