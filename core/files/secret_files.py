"""Secrets that the site makes itself and keeps in files. Imports no Django."""

import os
import secrets
from collections.abc import Callable
from pathlib import Path

from .private_folders import make_private_folder


def secret_from_file(path: Path, make: Callable[[], str] = lambda: secrets.token_urlsafe(50)) -> str:
    """The secret in ``path``, made on first use and readable by its owner only. Processes that start together agree on
    one."""
    if not path.exists():
        make_private_folder(path.parent)
        draft = path.with_name(f"{path.name}.{os.getpid()}")
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(descriptor, "w") as file:
            file.write(make())
        try:
            os.link(draft, path)
        except FileExistsError:
            pass
        finally:
            draft.unlink()
    return path.read_text().strip()
