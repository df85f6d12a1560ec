"""Stores static files under hashed names, each with a compressed twin."""

import os
from typing import Any

from whitenoise.storage import CompressedManifestStaticFilesStorage  # type: ignore[import-untyped]

_MODULES = ("viewer/*.js", "live/*.js", "training/drive-scene.js", "vendor/three*.js")


class StaticFiles(CompressedManifestStaticFilesStorage):
    """A file appears whole or not at all. A truncated one would be newer than its source, so the next collection would
    keep it. The viewer's modules import each other by their hashed names; those of packages are left alone, because
    some of them name files that they do not have."""

    patterns = (
        *CompressedManifestStaticFilesStorage.patterns,
        *((name, CompressedManifestStaticFilesStorage._js_module_import_aggregation_patterns[1]) for name in _MODULES),
    )

    def _save(self, name: str, content: Any) -> str:
        draft = super()._save(f"{name}.draft", content)
        os.replace(self.path(draft), self.path(name))
        return name
