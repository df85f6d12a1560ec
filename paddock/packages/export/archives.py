"""Files packed for a car, the same bytes for the same files."""

from __future__ import annotations

import io
import tarfile
import zlib
from collections.abc import Mapping, Sequence

_LEVEL = 0  # weights grow smaller by a twelfth only, and that would take ten times as long as all the rest
_GZIP = 31  # zlib's word for a gzip header without a name or a time

Part = bytes | memoryview


def tar_gz(files: Mapping[str, Sequence[Part]]) -> bytes:
    """The files, each in parts to be joined, as a ``.tar.gz`` without times and owners."""
    packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, _GZIP)
    packed = io.BytesIO()
    for name, parts in files.items():
        member = tarfile.TarInfo(name)
        member.size = sum(map(len, parts))
        member.mode = 0o644
        packed.write(packer.compress(member.tobuf(tarfile.USTAR_FORMAT)))
        for part in parts:
            packed.write(packer.compress(part))
        packed.write(packer.compress(bytes(-member.size % tarfile.BLOCKSIZE)))
    packed.write(packer.compress(bytes(2 * tarfile.BLOCKSIZE)))
    packed.write(packer.flush())
    return packed.getvalue()
