"""Restores a backup into an empty place.

Everything is checked before anything is written. The database comes last, so that an interrupted restore can be
repeated.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from django.conf import settings
from django.core.exceptions import SuspiciousFileOperation
from django.core.files import File
from django.core.files.storage import default_storage
from django.db import connection
from django.db.migrations.loader import MigrationLoader

from paddock.errors import PlatformFault, UserFault

from ..setup import missing_bucket
from . import databases, files
from .archive import DATABASE, FILES, SECRET_KEY, Backup, opened

UNFINISHED = "restore-"


@dataclass(frozen=True)
class Restored:
    """What was restored: when the backup was made (ISO 8601), how many files, and what was lost before it was made."""

    made_at: str
    files: int
    lost: list[str]


def restore(*, path: Path, tell: Callable[[str], None] = lambda text: None) -> Restored:
    """Restore a backup into the empty database and the empty storage of this site. ``tell`` receives the progress.

    Raises UserFault ``file_unreadable``, ``backup_damaged``, ``backup_other_database``, ``backup_newer``,
    ``restore_not_empty``, ``postgres_tools_missing`` before anything is changed, and PlatformFault ``storage_failed``,
    ``database_damaged``, ``database_tool_failed``, which leave the database empty.
    """
    with opened(path, tell) as backup:
        _refuse_unfit(backup)
        if not databases.is_empty():
            raise UserFault("restore_not_empty", place=_database_name())
        _make_bucket()
        _restore_files(backup, _files_there(backup), tell)
        tell("database")
        with files.working_folder(settings.DATA_DIR, UNFINISHED) as folder:
            _restore_key(backup, folder)
            target = folder / "database"
            with backup.open(DATABASE) as source, target.open("xb") as copy:
                shutil.copyfileobj(source, copy, 1 << 20)
            databases.restore_from(target)
        return Restored(backup.manifest["made_at"], len(backup.files), backup.manifest["lost"])


def _refuse_unfit(backup: Backup) -> None:
    vendor = backup.manifest["database"]
    if vendor != connection.vendor:
        raise UserFault("backup_other_database", theirs=vendor, ours=connection.vendor)
    known = {f"{room}.{name}" for room, name in MigrationLoader(None, ignore_no_migrations=True).disk_migrations}
    unknown = sorted(set(backup.manifest["migrations"]) - known)
    if unknown:
        raise UserFault("backup_newer", migration=unknown[0])


def _make_bucket() -> None:
    try:
        if settings.STORAGE != "local" and (create := missing_bucket()):
            create()
    except Exception as error:  # as each of its servers has it
        raise PlatformFault("storage_failed") from error


def _files_there(backup: Backup) -> set[str]:
    """Which of the backup's files are there already, as a restore that was cut off leaves them."""
    wanted = set(backup.files)
    there = set()
    for name in files.stored():
        if name not in wanted or not _is_the_same(backup, name):
            raise UserFault("restore_not_empty", place=f"{settings.STORAGE} ({name})")
        there.add(name)
    return there


def _is_the_same(backup: Backup, name: str) -> bool:
    try:
        with default_storage.open(name, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == backup.sha256(FILES + name)
    except Exception as error:  # each storage raises other classes
        raise PlatformFault("storage_failed") from error


def _restore_files(backup: Backup, there: set[str], tell: Callable[[str], None]) -> None:
    for number, name in enumerate(backup.files, 1):
        if name not in there:
            try:
                with backup.open(FILES + name) as content:
                    stored = default_storage.save(name, File(content, name=name))
            except SuspiciousFileOperation as error:  # no backup of ours names a file outside
                raise UserFault("backup_damaged", path=name, problem=str(error)) from error
            except Exception as error:
                raise PlatformFault("storage_failed") from error
            if stored != name:
                default_storage.delete(stored)
                raise UserFault("restore_not_empty", place=f"{settings.STORAGE} ({name})")
        tell(f"files: {number} of {len(backup.files)}")


def _restore_key(backup: Backup, folder: Path) -> None:
    """The key that signs sessions and links; where PADDOCK_SECRET_KEY names one the file is not looked at."""
    if SECRET_KEY not in backup:
        return
    draft = folder / "secret-key"
    with open(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(backup.open(SECRET_KEY).read())
    draft.replace(settings.DATA_DIR / "secret-key")


def _database_name() -> str:
    return str(connection.settings_dict["NAME"])
