"""What a storage of files fails with, whatever it is: a folder, a bucket over the network, a file cut short."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

from paddock.errors import PlatformFault

# by name: whoever keeps files in a folder never loads these
_CLIENTS = frozenset(("botocore", "boto3", "s3transfer", "urllib3"))
_DAMAGE = (EOFError, zlib.error, zipfile.BadZipFile)


def is_of_storage(error: BaseException) -> bool:
    """Whether an error can only come from stored files: a bucket's client raised it, or what was read is damaged."""
    modules = {kind.__module__.partition(".")[0] for kind in type(error).__mro__}
    return isinstance(error, zlib.error) or bool(modules & _CLIENTS)


@contextmanager
def storage_at_work() -> Iterator[None]:
    """Around every use of stored files: what it fails with becomes PlatformFault("storage_failed")."""
    try:
        yield
    except Exception as error:
        if isinstance(error, (OSError, *_DAMAGE)) or is_of_storage(error):
            raise PlatformFault("storage_failed") from error
        raise
