"""The site's own settings for a server that a test starts: what needs a broker or collected files does without."""

from __future__ import annotations

from config.settings import *  # noqa: F403
from config.settings import STORAGES

CACHES = {"default": {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}}
STORAGES = {**STORAGES, "staticfiles": {"BACKEND": "django.contrib.staticfiles.storage.StaticFilesStorage"}}
