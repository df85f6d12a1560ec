"""Stores static files under hashed names, each with a compressed twin."""

import os
from typing import Any

from whitenoise.storage import CompressedManifestStaticFilesStorage  # type: ignore[import-untyped]


class StaticFiles(CompressedManifestStaticFilesStorage):
    """A file appears whole or not at all. A truncated one would be newer than its source, so the next collection would
    keep it."""

    def _save(self, name: str, content: Any) -> str:
        draft = super()._save(f"{name}.draft", content)
        os.replace(self.path(draft), self.path(name))
        return name
