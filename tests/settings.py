"""The settings of the tests: a data folder of their own, and nothing that must be started first.

pytest reads this before anything else, so that the checkout's data folder is never touched. Processes that tests start
find the same folder through the environment.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

if "PADDOCK_TEST_DATA" not in os.environ:
    os.environ["PADDOCK_TEST_DATA"] = tempfile.mkdtemp(prefix="paddock-tests-")
os.environ["PADDOCK_DATA"] = str(Path(os.environ["PADDOCK_TEST_DATA"]) / os.environ.get("PYTEST_XDIST_WORKER", "main"))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
os.environ.setdefault("PADDOCK_SHARED_PAGE_SECONDS", "0")  # a test that shares parts between requests sets it

from config.settings import *  # noqa: F403
from config.settings import DATA_DIR, DATABASES, STORAGES

if DATABASES["default"]["ENGINE"] == "django.db.backends.sqlite3":
    # a real file: in memory there is no WAL, and other threads and processes see nothing
    DATABASES["default"]["TEST"] = {"NAME": str(DATA_DIR / "test.sqlite3")}

CUP_TIME = ""  # no cup of the day but those that tests hold
LTI = True  # its pages are there; a site without it is a test of its own
TRAINING = True  # the site's side needs no torch; tests that really train are skipped where it is missing

MFA_SUPPORTED_TYPES = ["totp", "recovery_codes", "webauthn"]  # their pages are there, whatever the site's address

CACHES = {"default": {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}}
STREAM_BELL_URL = ""  # nobody listens
STORAGES = {**STORAGES, "staticfiles": {"BACKEND": "django.contrib.staticfiles.storage.StaticFilesStorage"}}
STATIC_ROOT = DATA_DIR / "static"
STATIC_ROOT.mkdir(exist_ok=True)  # WhiteNoise warns about a missing one
PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]
