"""A whole site, really run, on which a live event is shown: its processes, its rows, its visitors."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.collected import collected
from tests.config.test_run import READY, Run, environment, rows
from tests.evaluation.processes import wait_for
from tests.shared import CHECKOUT

START_S = 300.0  # on a machine with much other work
QUIET = {"PADDOCK_TRAINING": "False", "PADDOCK_VIDEOS": "False"}  # nobody trains or films tonight


class LiveSite(Run):
    """``manage.py run`` on a data folder; what it prints is in ``log``."""

    def __init__(self, data: Path, port: int | None = None) -> None:
        super().__init__(data, port, **QUIET, **collected())

    def ready(self) -> LiveSite:
        wait_for(lambda: READY.search(self.said) or self.process.poll() is not None, START_S, self.log)
        assert READY.search(self.said), self.said
        return self

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def make(self, what: str, **given: Any) -> dict[str, Any]:
        """Rows of :mod:`tests.night_rows`."""
        words = [f"{key}={json.dumps(value)}" for key, value in given.items()]
        done = subprocess.run(
            [sys.executable, "-m", "tests.night_rows", what, *words],
            cwd=CHECKOUT,
            env=environment(self.data) | QUIET | collected() | {"DJANGO_SETTINGS_MODULE": "config.settings"},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr[-4000:]
        return json.loads(done.stdout.splitlines()[-1])

    def rows(self, query: str) -> list[tuple]:
        return rows(self.data, query)

    def visit(self, browser: Any, session: str | None = None, **options: Any) -> Any:
        """A page of a browser of its own, of a guest or of who has this session; its faults are kept in ``faults``."""
        context = browser.new_context(base_url=self.address, locale="en-GB", **options)
        context.set_default_timeout(60_000)
        if session is not None:
            context.add_cookies([{"name": "sessionid", "value": session, "url": self.address}])
        return context.new_page()
