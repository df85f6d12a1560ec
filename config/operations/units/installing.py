"""Writes the units where systemd reads them: all of them or none."""

import os
import pwd
import shlex
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from django.conf import settings

from .rendering import refused
from .texts import HEADER


def install_units(
    *, units: Mapping[str, str], user: str, directory: Path, env_file: Path, backups: Path | None = None
) -> list[str]:
    """Write the units into ``directory``, and delete those of an earlier time that are none of them. Returns the names
    of the deleted. Raises UserFault ``units_refused``, and then nothing was changed."""
    if os.geteuid() != 0:
        raise refused("only root may; --print shows them to everybody")
    _check_environment(env_file)
    if backups is not None and not backups.is_dir():
        raise refused(f"there is no folder {backups}; make it: install -d -o {user} -m 700 {backups}")
    _hand_over_data(user)
    try:
        with tempfile.TemporaryDirectory(prefix=".paddock-units-", dir=directory) as folder:
            for name, text in units.items():
                draft = Path(folder) / name
                draft.write_text(text)
                draft.chmod(0o644)
            old = [path for path in directory.glob("paddock-*.*") if path.name not in units and _is_ours(path)]
            for name in units:
                (Path(folder) / name).replace(directory / name)
    except OSError as error:
        raise refused(f"{error.filename or directory}: {error.strerror}") from error
    for path in old:
        path.unlink()
    return sorted(path.name for path in old)


def _is_ours(path: Path) -> bool:
    with suppress(OSError, UnicodeDecodeError):
        return path.is_file() and path.read_text().startswith(HEADER)
    return False


def _check_environment(env_file: Path) -> None:
    """The units are rendered by this process's settings and run with those of the file."""
    try:
        lines = shlex.split(env_file.read_text(), comments=True)
    except OSError as error:
        raise refused(f"{env_file}, the settings of all programs: {error.strerror}") from error
    except ValueError as error:
        raise refused(f"{env_file}: {error}") from error
    for line in lines:
        name, _, value = line.partition("=")
        if os.environ.get(name) != value:
            load = f"set -a; . {env_file}; set +a"
            raise refused(f"{name} of {env_file} is not set in this shell; load that file first: {load}")


def _hand_over_data(user: str) -> None:
    """Root has read the settings, which makes what is missing in the data folder."""
    try:
        owner = pwd.getpwnam(user)
    except KeyError:
        raise refused(f"there is no user {user}; create it, for example with useradd --system {user}") from None
    data = settings.DATA_DIR
    ours = [path for path in (data, *data.iterdir()) if path.lstat().st_uid != owner.pw_uid]
    for path in ours:
        if path.lstat().st_uid != 0 or (path.is_dir() and path != data and any(path.iterdir())):
            raise refused(f"{path} is not {user}'s; give it to that user: chown -R {user}: {data}")
    for path in ours:
        os.chown(path, owner.pw_uid, owner.pw_gid, follow_symlinks=False)
