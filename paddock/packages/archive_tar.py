"""A strict streaming reader of tar archives."""

# :mod:`.compressed` decompresses the stream. The standard library reads a header extension of any length into memory
# and accepts links, sparse files and devices, which no car needs. Accepted here: ustar, GNU long names, and pax headers
# with times, owners and names only. Format: POSIX.1-2017 pax; GNU tar manual, "Basic Tar Format".

import io
from collections.abc import Callable, Iterable, Iterator

from paddock.errors import UserFault

from .choose import is_network, is_wanted_early
from .limits import PackageLimits
from .members import Catalogue

_BLOCK = 512
_CHUNK = 64 * 1024
_EXTENSION_LIMIT = 16 * 1024
_FILES = (b"0", b"\0")
_FOLDER, _GNU_NAME, _PAX, _PAX_GLOBAL = b"5", b"L", b"x", b"g"
_PAX_IGNORED = {b"mtime", b"atime", b"ctime", b"uid", b"gid", b"uname", b"gname", b"comment", b"hdrcharset", b"charset"}
_PAX_IGNORED_PREFIXES = (b"SCHILY.", b"LIBARCHIVE.")


def scan_tar(
    chunks: Iterator[bytes], limits: PackageLimits, keep: Callable[[str, int], bool]
) -> tuple[dict[str, int], dict[str, bytes]]:
    """One pass over a tar stream: all its files (``{clean name: size}``), and the content of those that ``keep``
    (name, size) asks for. Raises UserFault for all out of the ordinary."""
    source = _Source(chunks)
    catalogue = Catalogue(limits)
    kept: dict[str, bytes] = {}
    long_name: bytes | None = None
    headers = 0
    while True:
        header = source.take(_BLOCK)
        if not header.strip(b"\0"):
            source.expect_zeros()
            return catalogue.sizes, kept
        headers += 1
        if headers > 4 * limits.archive_members:
            raise UserFault("too_many_members", limit=limits.archive_members)
        kind, size = _check(header)
        padding = -size % _BLOCK
        if kind in (_PAX, _PAX_GLOBAL, _GNU_NAME):
            if size > _EXTENSION_LIMIT:
                raise UserFault("archive_unsupported")
            extension = source.take(size)
            source.skip(padding)
            named = extension.rstrip(b"\0") if kind == _GNU_NAME else _pax_name(extension)
            long_name = named or long_name
            continue
        raw, long_name = long_name or _name(header), None
        if kind == _FOLDER or (kind in _FILES and raw.endswith(b"/")):
            catalogue.folder(raw)
            source.skip(size + padding)
        elif kind in _FILES:
            member = _Member(source, size)
            name = catalogue.file(raw, size, member.is_copy_of(kept))
            if name is not None and keep(name, size):
                kept[name] = member.read()
            source.skip(member.left + padding)
        else:
            raise UserFault("unexpected_member", member="a link or device")


class TarArchive:
    """A tar that can be read again. ``sizes``: its files by clean name.

    One pass keeps the first network and small files that the choice may need. Only if another file is chosen, a second
    pass fetches it. ``again``: gives the stream's chunks from the beginning.
    """

    def __init__(self, chunks: Iterator[bytes], again: Callable[[], Iterator[bytes]], limits: PackageLimits) -> None:
        self._again, self._limits = again, limits
        has_network = False

        def keep(name: str, size: int) -> bool:
            nonlocal has_network
            if is_network(name):
                if size > limits.model_bytes:
                    raise UserFault("model_too_large", limit_mb=limits.model_bytes >> 20)
                is_first, has_network = not has_network, True
                return is_first
            return is_wanted_early(name) and size <= limits.metadata_bytes

        self.sizes, self._kept = scan_tar(chunks, limits, keep)

    def read(self, names: Iterable[str]) -> dict[str, bytes]:
        """The content of these files; a second pass drops all other kept content."""
        wanted = set(names)
        if missing := wanted - self._kept.keys():
            self._kept = {name: content for name, content in self._kept.items() if name in wanted}
            self._kept |= scan_tar(self._again(), self._limits, lambda name, _size: name in missing)[1]
        if wanted - self._kept.keys():
            raise UserFault("archive_corrupt")  # the stream differs the second time
        return {name: self._kept[name] for name in wanted}


class _Source:
    """Takes exact amounts out of a stream of chunks."""

    def __init__(self, chunks: Iterator[bytes]) -> None:
        self._chunks = chunks
        self._rest = b""

    def take(self, size: int) -> bytes:
        taken, missing = io.BytesIO(), size  # gives its bytes away without a copy, which a list of parts does not
        while missing:
            if not self._rest:
                self._rest = next(self._chunks, b"")
                if not self._rest:
                    raise UserFault("archive_corrupt")
            part, self._rest = self._rest[:missing], self._rest[missing:]
            taken.write(part)
            missing -= len(part)
        return taken.getvalue()

    def skip(self, size: int) -> None:
        while size:
            size -= len(self.take(min(size, _CHUNK)))

    def expect_zeros(self) -> None:
        """Read to the end, so that the stream's checksum is checked. Only zeros may follow the end mark."""
        rest = self._rest
        while True:
            if rest.strip(b"\0"):
                raise UserFault("archive_corrupt")
            rest = next(self._chunks, b"")
            if not rest:
                return


class _Member:
    """One file of a tar, which is read at most once."""

    def __init__(self, source: _Source, size: int) -> None:
        self._source, self.left = source, size

    def read(self) -> bytes:
        size, self.left = self.left, 0
        return self._source.take(size)

    def is_copy_of(self, kept: dict[str, bytes]) -> Callable[[str], bool]:
        """Whether it equals an earlier file, if that one was kept."""
        return lambda name: name in kept and self.read() == kept[name]


def _check(header: bytes) -> tuple[bytes, int]:
    """The type and the size of a header block with a right checksum."""
    total = sum(header[:148]) + 8 * 32 + sum(header[156:])
    if _octal(header[148:156]) != total or header[257:262] not in (b"ustar", bytes(5)):  # the latter is of Unix V7
        raise UserFault("archive_corrupt")
    return header[156:157], _octal(header[124:136])


def _octal(field: bytes) -> int:
    """A number field. The base-256 form is for files beyond 8 GB and refused."""
    digits = field.strip(b"\0 ")
    if not digits or len(digits) > 11 or digits.strip(b"01234567"):
        raise UserFault("archive_corrupt")
    return int(digits, 8)


def _name(header: bytes) -> bytes:
    name = header[:100].split(b"\0", 1)[0]
    prefix = header[345:500].split(b"\0", 1)[0] if header[257:263] == b"ustar\0" else b""
    return prefix + b"/" + name if prefix else name


def _pax_name(extension: bytes) -> bytes | None:
    """The ``path`` of a pax header, if it has one. Records that change anything else are refused."""
    name, at = None, 0
    while at < len(extension):
        space = extension.find(b" ", at, at + 8)
        digits = extension[at:space] if space > 0 else b""
        if not digits.isdigit():
            raise UserFault("archive_corrupt")
        end = at + int(digits)
        record = extension[space + 1 : end]
        if end > len(extension) or not record.endswith(b"\n") or b"=" not in record:
            raise UserFault("archive_corrupt")
        key, value = record[:-1].split(b"=", 1)
        if key == b"path":
            name = value
        elif key not in _PAX_IGNORED and not key.startswith(_PAX_IGNORED_PREFIXES):
            raise UserFault("archive_unsupported")
        at = end
    return name
