"""The form of a backup: a tar with a sum for each member, and all sums and their sum at its end."""

import hashlib
import io
import json
import os
import tarfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TypedDict

from paddock.errors import UserFault

FORMAT = 1
DATABASE, SECRET_KEY, MANIFEST, SEAL = "database", "secret-key", "manifest.json", "manifest.sha256"
FILES = "files/"
PIECE = 1 << 20
_MANIFEST_LIMIT = 1 << 30
_SEAL_LENGTH = 64


class Member(TypedDict):
    size: int
    sha256: str


class BackupFacts(TypedDict):
    """The facts of a backup. ``files``: the stored files that are in it; ``made_at``: ISO 8601."""

    made_at: str
    database: str
    engine: str
    migrations: list[str]
    files: list[str]
    lost: list[str]
    damaged: list[str]


class Manifest(BackupFacts):
    format: int
    members: dict[str, Member]


class Writer:
    """Writes members one after the other. Nothing counts before :meth:`seal`: a file that was cut off is refused."""

    def __init__(self, file: IO[bytes], mtime: int) -> None:
        self.members: dict[str, Member] = {}
        self.size = 0
        self._mtime = mtime
        self._tar = tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT)  # noqa: SIM115  seal() ends it

    def add(self, name: str, content: IO[bytes], size: int) -> str:
        """Add ``size`` bytes of ``content`` under a new name; their sha-256. Raises OSError."""
        info = tarfile.TarInfo(name)
        info.size, info.mode, info.mtime = size, 0o600, self._mtime
        hashed = _Hashed(content)
        self._tar.addfile(info, hashed)
        self.members[name] = {"size": size, "sha256": hashed.digest.hexdigest()}
        self.size += size
        return self.members[name]["sha256"]

    def add_path(self, name: str, path: Path) -> str:
        with path.open("rb") as file:
            return self.add(name, file, path.stat().st_size)

    def seal(self, facts: BackupFacts) -> None:
        """Write the manifest, ``facts`` in it, and end the archive. Raises OSError."""
        manifest = json.dumps({"format": FORMAT, **facts, "members": self.members}, indent=1).encode()
        for name, content in ((MANIFEST, manifest), (SEAL, hashlib.sha256(manifest).hexdigest().encode())):
            info = tarfile.TarInfo(name)
            info.size, info.mode, info.mtime = len(content), 0o600, self._mtime
            self._tar.addfile(info, io.BytesIO(content))
        self._tar.close()


class Backup:
    """A backup whose every byte was found as it was written. Made by :func:`opened`."""

    def __init__(self, tar: tarfile.TarFile, manifest: Manifest, infos: dict[str, tarfile.TarInfo]) -> None:
        self.manifest = manifest
        self._tar, self._infos = tar, infos

    @property
    def files(self) -> list[str]:
        """The names of the stored files that its database refers to, as far as there were any."""
        return self.manifest["files"]

    def sha256(self, member: str) -> str:
        return self.manifest["members"][member]["sha256"]

    def __contains__(self, member: str) -> bool:
        return member in self.manifest["members"]

    def open(self, member: str) -> IO[bytes]:
        content = self._tar.extractfile(self._infos[member])
        assert content is not None, "only plain files pass opened()"
        return content


@contextmanager
def opened(path: Path, tell: Callable[[str], None] = lambda text: None) -> Iterator[Backup]:
    """Check a backup from its first byte to its last, and open it. ``tell`` receives the progress. Raises UserFault
    ``backup_damaged``, and ``file_unreadable``."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise UserFault("file_unreadable", path=str(path), problem=error.strerror or str(error)) from error
    with file:
        try:
            tar = tarfile.open(fileobj=file, mode="r:")  # noqa: SIM115  of an open file
            manifest, infos = _checked(tar, os.fstat(file.fileno()).st_size, tell)
        except tarfile.TarError as error:
            raise _damaged(path, "it is no backup, or its end is missing") from error
        except OSError as error:
            raise UserFault("file_unreadable", path=str(path), problem=error.strerror or str(error)) from error
        except _Wrong as wrong:
            raise _damaged(path, str(wrong)) from wrong
        yield Backup(tar, manifest, infos)


class _Wrong(Exception):
    """What is wrong with a backup."""


class _Hashed:
    """A file that is hashed while it is read."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self.digest = file, hashlib.sha256()

    def read(self, size: int = -1) -> bytes:
        piece = self._file.read(size)
        self.digest.update(piece)
        return piece


def _checked(
    tar: tarfile.TarFile, size: int, tell: Callable[[str], None]
) -> tuple[Manifest, dict[str, tarfile.TarInfo]]:
    infos: dict[str, tarfile.TarInfo] = {}
    found: dict[str, str] = {}
    kept: dict[str, bytes] = {}
    for info in tar:
        if not info.isreg() or info.name in infos:
            raise _Wrong(f"{info.name} does not belong there")
        infos[info.name] = info
        content = tar.extractfile(info)
        assert content is not None
        if info.name in (MANIFEST, SEAL):
            if info.size > (_SEAL_LENGTH if info.name == SEAL else _MANIFEST_LIMIT):
                raise _Wrong(f"{info.name} is too large")
            kept[info.name] = content.read()
        else:
            found[info.name] = hashlib.file_digest(content, "sha256").hexdigest()  # type: ignore[arg-type]
        tell(f"checking: {100 * (info.offset_data + info.size) // max(size, 1)} %")
    if SEAL not in kept or MANIFEST not in kept:
        raise _Wrong("its end is missing")
    if hashlib.sha256(kept[MANIFEST]).hexdigest().encode() != kept[SEAL]:
        raise _Wrong("its list of sums is damaged")
    manifest: Manifest = json.loads(kept[MANIFEST])
    if manifest["format"] != FORMAT:
        raise _Wrong(f"it is of form {manifest['format']}, and this version of Paddock reads form {FORMAT}")
    for name, member in manifest["members"].items():
        if found.pop(name, None) != member["sha256"]:
            raise _Wrong(f"{name} is not what it was when the backup was made")
    if found:
        raise _Wrong(f"{min(found)} does not belong there")
    return manifest, infos


def _damaged(path: Path, problem: str) -> UserFault:
    return UserFault("backup_damaged", path=str(path), problem=problem)
