"""Makes a backup while the site runs.

Stored files are never changed, so the order is: all files of now, then the database of one moment, then the files that
came before that moment. Should a file have come and gone in between, a newer moment is taken.
"""

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.files.storage import default_storage
from django.db import connection

from evaluation.models import StoredFile
from paddock.errors import PlatformFault, UserFault
from paddock.simulator.engine import ENGINE_ID

from . import files
from .archive import DATABASE, FILES, PIECE, SECRET_KEY, Writer
from .databases import applied_migrations, snapshot

ROUNDS = 5
UNFINISHED = ".paddock-backup-"
IN_MEMORY = 16 << 20


@dataclass
class Made:
    """A finished backup: path, size in bytes, number of files, and the files that are lost, or included and damaged."""

    path: Path
    size: int = 0
    files: int = 0
    lost: list[str] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)


def back_up(*, path: Path, now: datetime, tell: Callable[[str], None] = lambda text: None) -> Made:
    """Write all of this site into a new file, readable by its owner only, that appears when it is complete.

    ``tell`` receives the progress. Lost files are named and do not stop the backup. Raises UserFault ``backup_exists``,
    ``file_unwritable``, ``postgres_tools_missing`` and PlatformFault ``storage_failed``, ``database_damaged``,
    ``database_tool_failed``; then nothing is left behind.
    """
    if os.path.lexists(path):
        raise UserFault("backup_exists", path=str(path))
    made = Made(path)
    with _refuse_write_errors(path), files.working_folder(path.parent, UNFINISHED) as folder:
        part = folder / "backup"
        with part.open("xb") as file:
            _write(Writer(file, int(now.timestamp())), folder, now, tell, made)
            file.flush()
            os.fsync(file.fileno())
            made.size = file.tell()
        part.chmod(0o600)
        _appear(part, path)
    return made


def _write(archive: Writer, folder: Path, now: datetime, tell: Callable[[str], None], made: Made) -> None:
    taken: set[str] = set()
    damaged: set[str] = set()
    _take(archive, files.referred_to(_ask), taken, damaged, folder, tell)
    for last in (*[False] * (ROUNDS - 1), True):
        tell("database: one moment of it")
        with snapshot(folder) as moment:
            lost = _take(archive, moment.files, taken, damaged, folder, tell)
            settled = all(files.is_referred_to(_ask, name) for name in lost)
            if not settled and not last:
                continue
            tell(f"database: {moment.path.stat().st_size >> 20} MB")
            archive.add_path(DATABASE, moment.path)
            break
    key = settings.DATA_DIR / "secret-key"
    if key.is_file():
        archive.add_path(SECRET_KEY, key)
    made.lost, made.files = sorted(lost), len(moment.files) - len(lost)
    made.damaged = sorted(damaged & moment.files)
    archive.seal(
        {
            "made_at": now.isoformat(),
            "database": connection.vendor,
            "engine": ENGINE_ID,
            "migrations": applied_migrations(),
            "files": sorted(moment.files - lost),
            "lost": made.lost,
            "damaged": made.damaged,
        }
    )


def _take(
    archive: Writer, names: Iterable[str], taken: set[str], damaged: set[str], folder: Path, tell: Callable[[str], None]
) -> set[str]:
    """Add the files that are not in the archive yet; returns those that are gone. ``taken``, ``damaged``: get their
    names."""
    wanted = sorted(set(names) - taken)
    gone: set[str] = set()
    for number, name in enumerate(wanted, 1):
        with tempfile.SpooledTemporaryFile(IN_MEMORY, dir=str(folder)) as copy:
            # a storage need not know a size, and a file may vanish half-way: the tar gets what was read to its end
            if not _copied(name, copy):
                gone.add(name)
                continue
            size = copy.tell()
            copy.seek(0)
            sha256 = archive.add(FILES + name, copy, size)
        taken.add(name)
        if StoredFile.objects.filter(name=name).exclude(sha256="").exclude(sha256=sha256).exists():
            damaged.add(name)
        tell(f"files: {number} of {len(wanted)}, {archive.size >> 20} MB")
    return gone


def _copied(name: str, copy: Any) -> bool:
    """Whether there was such a file. Raises PlatformFault ``storage_failed``."""
    try:
        with default_storage.open(name, "rb") as file:
            while piece := file.read(PIECE):
                copy.write(piece)
    except FileNotFoundError:
        return False
    except Exception as error:  # each storage raises other classes
        raise PlatformFault("storage_failed") from error
    return True


def _ask(statement: str, params: list[str] | None = None) -> list[tuple[Any, ...]]:
    with connection.cursor() as cursor:
        cursor.execute(statement, params)
        return cursor.fetchall()


@contextmanager
def _refuse_write_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise UserFault("file_unwritable", path=str(path), problem=error.strerror or str(error)) from error


def _appear(part: Path, path: Path) -> None:
    """Give the file its name, unless there is one of that name by now; it is there after a power failure, too."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise UserFault("backup_exists", path=str(path)) from None
    except OSError:  # a file system without hard links
        if os.path.lexists(path):
            raise UserFault("backup_exists", path=str(path)) from None
        part.rename(path)
    with suppress(OSError):
        descriptor = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
