"""The errors of a file storage: of a folder, of a bucket, of a truncated file."""

import errno
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

from paddock.errors import PlatformFault

# by name, because sites with files in a folder never import these
_CLIENTS = frozenset(("botocore", "boto3", "s3transfer", "urllib3"))
_FULL = frozenset((errno.ENOSPC, errno.EDQUOT))
_DAMAGE = (EOFError, zlib.error, zipfile.BadZipFile)


def is_of_storage(error: BaseException) -> bool:
    """Whether an error comes from stored files: a bucket's client, damaged data or a full disk."""
    modules = {kind.__module__.partition(".")[0] for kind in type(error).__mro__}
    is_full = isinstance(error, OSError) and error.errno in _FULL
    return is_full or isinstance(error, zlib.error) or bool(modules & _CLIENTS)


def is_outage_of_storage(error: BaseException) -> bool:
    """Whether the storage does not answer now, as opposed to one damaged or missing file."""
    cause = error.__cause__ if isinstance(error, PlatformFault) and error.code == "storage_failed" else error
    if isinstance(cause, (FileNotFoundError, *_DAMAGE)):
        return False
    return cause is not None and (is_of_storage(cause) or (cause is not error and isinstance(cause, OSError)))


@contextmanager
def storage_at_work() -> Iterator[None]:
    """Around every use of stored files: what it fails with becomes PlatformFault("storage_failed")."""
    try:
        yield
    except Exception as error:
        if isinstance(error, (OSError, *_DAMAGE)) or is_of_storage(error):
            raise PlatformFault("storage_failed") from error
        raise
