"""What a site answers, as sums: run by tests in a process of its own, on whatever data the environment names.

``python -m tests.config.backed_up ALIAS ADDRESS ...`` prints ``{address: [status, sha-256]}`` as JSON.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterable

_CHANGING = re.compile(rb'nonce="[^"]*"|name="csrfmiddlewaretoken" value="[^"]*"')


def answers(alias: str, addresses: Iterable[str]) -> dict[str, list]:
    """Status and sha-256 of what this racer gets at each address, without what is drawn anew for each page."""
    from django.test import Client

    from accounts.models import Racer

    client, got = Client(), {}
    client.force_login(Racer.objects.get(alias=alias), "django.contrib.auth.backends.ModelBackend")
    for address in addresses:
        answer = client.get(address, HTTP_HOST="localhost", HTTP_ACCEPT="*/*")
        content = b"".join(answer.streaming_content) if answer.streaming else answer.content
        got[address] = [answer.status_code, hashlib.sha256(_CHANGING.sub(b"", content)).hexdigest()]
    return got


if __name__ == "__main__":
    import django

    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "config.settings")
    django.setup()
    from django.conf import settings

    settings.STORAGES["staticfiles"]["BACKEND"] = "django.contrib.staticfiles.storage.StaticFilesStorage"
    settings.CACHES["default"] = {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}
    print(json.dumps(answers(sys.argv[1], sys.argv[2:])))
