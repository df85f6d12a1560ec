"""A small site of its own for tests of what is around it: its rows, its web server, and somebody who uses it."""

from __future__ import annotations

import http.cookiejar
import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.collected import collected
from tests.evaluation.processes import wait_for
from tests.shared import CHECKOUT

PASSWORD = "correct horse battery"
RACES = 7
_OURS = ("PADDOCK_", "DJANGO_", "DATABASE_URL", "CELERY_", "CACHE_URL", "PYTEST_", "STORAGE", "AWS_")
_ROWS = f"""
import django; django.setup()
import json
from django.core.management import call_command
from django.utils import timezone
from races.entries.services.submissions import submit_model
from tests.factories import a_model, a_race, a_track
from accounts.models import Racer
call_command("migrate", interactive=False, verbosity=0)
now = timezone.now()
alice = Racer.objects.create_user("alice", "alice@example.org", {PASSWORD!r})
races = [a_race(now, slug=f"race-{{number}}", name=f"Race {{number}}") for number in range({RACES})]
first = submit_model(race=races[0], racer=alice, model=a_model(alice), now=now)
model = a_model(alice)
print(json.dumps({{"model": model.public_id, "evaluation": first.evaluation.public_id}}))
"""


class Answer(NamedTuple):
    """What came back of a request."""

    status: int
    text: str


class SmallSite:
    """A data folder and what runs on it. ``environment``: of every process of the site."""

    def __init__(self, data: Path, **environment: str) -> None:
        kept = {name: value for name, value in os.environ.items() if not name.startswith(_OURS)}
        own = {"PADDOCK_DATA": str(data), "DJANGO_SETTINGS_MODULE": "config.settings"}
        self.environment = kept | own | collected() | environment
        self.log = data.parent / "web.log"
        self.rows: dict[str, str] = json.loads(self.python(_ROWS).splitlines()[-1])
        self.address = ""

    def python(self, code: str) -> str:
        """Run code as the site would; what it prints."""
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=CHECKOUT, env=self.environment, capture_output=True, text=True, timeout=90
        )
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    @contextmanager
    def served(self) -> Iterator[Somebody]:
        """The site's web server, and somebody who has a browser."""
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.address = f"http://127.0.0.1:{port}"
        with self.log.open("wb") as output:
            process = subprocess.Popen(
                [sys.executable, "-m", "config.web", "--port", str(port), "--processes", "1"],
                **{"cwd": CHECKOUT, "env": self.environment, "stdout": output, "stderr": subprocess.STDOUT},
                start_new_session=True,
            )
        try:
            somebody = Somebody(self.address)
            wait_for(lambda: _lives(somebody), 60, self.log)
            yield somebody
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(30)


class Somebody:
    """A browser without a screen: cookies, forms with their token, and the API in the same session."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._cookies = http.cookiejar.CookieJar()
        self._open = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(self._cookies)).open

    def get(self, path: str) -> Answer:
        return self._ask(urllib.request.Request(self._address + path))

    def post(self, path: str, fields: dict[str, str], form_at: str | None = None) -> Answer:
        """Send a form as it stands on the page ``form_at`` (``path`` itself)."""
        page = self.get(form_at or path)
        assert page.status == 200, page
        token = re.search(r'name="csrfmiddlewaretoken" value="(\w+)"', page.text)
        body = urllib.parse.urlencode({**fields, "csrfmiddlewaretoken": token[1] if token else ""}).encode()
        return self._ask(urllib.request.Request(self._address + path, data=body, headers={"Referer": self._address}))

    def send(self, path: str, content: dict[str, str]) -> Answer:
        """A request of the API that writes, in the same session."""
        token = next((cookie.value for cookie in self._cookies if cookie.name == "csrftoken"), "") or ""
        headers = {"Content-Type": "application/json", "X-CSRFToken": token, "Referer": self._address}
        return self._ask(
            urllib.request.Request(self._address + path, data=json.dumps(content).encode(), headers=headers)
        )

    def log_in(self, password: str = PASSWORD) -> Answer:
        return self.post("/accounts/login/", {"login": "alice", "password": password})

    def _ask(self, request: urllib.request.Request) -> Answer:
        try:
            with self._open(request, timeout=60) as answer:
                return Answer(answer.status, answer.read().decode("utf-8", "replace"))
        except urllib.error.HTTPError as error:
            with error:
                return Answer(error.code, error.read().decode("utf-8", "replace"))


def _lives(somebody: Somebody) -> bool:
    try:
        return somebody.get("/health/live").status == 200
    except OSError:
        return False
