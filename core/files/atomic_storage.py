"""File storage in a local folder that writes each file completely or not at all."""

import uuid
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from django.core.files.storage import FileSystemStorage

from .private_folders import make_private_folder

UNFINISHED = "unfinished"


class WholeFileStorage(FileSystemStorage):
    """Writes into the folder :data:`UNFINISHED` and renames complete files: Django would leave partial ones."""

    def _save(self, name: str, content: Any) -> str:
        part = f"{UNFINISHED}/{uuid.uuid4().hex}"
        try:
            super()._save(part, content)  # type: ignore[misc]
            return self._rename(part, name)
        finally:
            with suppress(OSError):
                self.delete(part)

    def _rename(self, part: str, name: str) -> str:
        """Rename a complete file to its name, or to the next free name."""
        make_private_folder(Path(self.path(name)).parent)
        while True:
            try:
                Path(self.path(name)).touch(mode=0o600, exist_ok=False)  # reserves the name
            except FileExistsError:
                name = self.get_available_name(name)
                continue
            try:
                Path(self.path(part)).replace(self.path(name))
            except OSError:
                self.delete(name)
                raise
            return name

    def delete_unfinished(self, before: datetime) -> None:
        """Delete what killed processes left half written."""
        for path in Path(self.path(UNFINISHED)).glob("*"):
            with suppress(OSError):  # its writer is quicker
                if path.stat().st_mtime < before.timestamp():
                    path.unlink()
