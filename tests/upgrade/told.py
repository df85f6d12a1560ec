"""What a site tells, as JSON: run in a process of its own on whatever data the environment names.

``python -m tests.upgrade.told`` finds the addresses by itself, from the home page on, and ``... told RECORD.json`` asks
for those of a record. It uses nothing of the code but the site's front, so that an old version and a new one may be
asked the same. The clock stands still at :data:`MOMENT`.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

MOMENT = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)
RACERS = ("", "alice", "boss")  # a guest, a racer, an admin
MOST = 60  # addresses for each
_LINK = re.compile(r'href="(/[^"#?]*)')
_NOT_TO_FOLLOW = re.compile(r"^/(static|logout|accounts/logout|admin/(logout|jsi18n)|i18n|api/schema)")


def told(record: dict[str, Any] | None = None) -> dict[str, Any]:
    """``{"pages": {racer: {address: status}}, "api": {address: body}, "files": {address: sha-256}}``."""
    from django.test import Client

    from accounts.models import Racer

    said: dict[str, Any] = {"pages": {}, "api": {}, "files": {}}
    for alias in RACERS:
        client = Client(HTTP_HOST="localhost")
        if alias:
            client.force_login(Racer.objects.get(alias=alias), "django.contrib.auth.backends.ModelBackend")
        known = None if record is None else list(record["pages"][alias])
        said["pages"][alias] = _pages(client, known)
    client = Client(HTTP_HOST="localhost", HTTP_ACCEPT="application/json")
    client.force_login(Racer.objects.get(alias="alice"), "django.contrib.auth.backends.ModelBackend")
    for address in record["api"] if record else _api(client):
        said["api"][address] = client.get(address).json()
        if address.startswith("/api/v1/evaluations/"):
            trace = f"{address.removeprefix('/api/v1')}trace.csv"
            content = client.get(trace, HTTP_ACCEPT="*/*").content
            said["files"][trace] = hashlib.sha256(content).hexdigest()
    return said


def _pages(client: Any, known: list[str] | None) -> dict[str, int]:
    wanted, got = known or ["/"], {}
    for address in wanted:  # it grows meanwhile
        answer = client.get(address)
        got[address] = answer.status_code
        if known is None and answer.get("Content-Type", "").startswith("text/html"):
            found = [link for link in _LINK.findall(answer.content.decode()) if not _NOT_TO_FOLLOW.match(link)]
            wanted += [link for link in dict.fromkeys(found) if link not in wanted][: MOST - len(wanted)]
    return got


def _api(client: Any) -> list[str]:
    """The lists, and each thing in them."""
    addresses = []
    for part, key, more in (
        ("races", "slug", ("", "board/")),
        ("models", "public_id", ("",)),
        ("seasons", "slug", ("", "standings/")),
        ("webhooks", "id", ("",)),
        ("notices", None, ()),
    ):
        listed = client.get(f"/api/v1/{part}/")
        if listed.status_code != 200:
            continue
        rows = listed.json()["results"]
        addresses.append(f"/api/v1/{part}/")
        addresses += [f"/api/v1/{part}/{row[key]}/{rest}" for row in rows if key in row for rest in more]
    boards = [client.get(address).json()["results"] for address in addresses if address.endswith("/board/")]
    addresses += [f"/api/v1/evaluations/{row['evaluation']}/" for rows in boards for row in rows if row["evaluation"]]
    return [address for address in addresses if client.get(address).status_code == 200]


def set_up() -> None:
    """Django on the data of the environment, without what a site has to start first."""
    import django

    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    from django.conf import settings
    from django.utils import timezone

    settings.STORAGES["staticfiles"]["BACKEND"] = "django.contrib.staticfiles.storage.StaticFilesStorage"
    settings.CACHES["default"] = {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}
    timezone.now = lambda: MOMENT


if __name__ == "__main__":
    set_up()
    print(json.dumps(told(json.loads(Path(sys.argv[1]).read_text()) if sys.argv[1:] else None)))
