"""The command, called in this process: what it says and its exit status."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from django.core.cache import cache
from django.utils import timezone

from accounts.tokens.services import create_token
from evaluation.running.queue.worker import run_next_evaluation
from paddock.cli import asking, settings
from paddock.cli import site as site_module
from paddock.cli.main import main
from tests.factories import a_race, a_racer


@dataclass(frozen=True)
class Said:
    """How a call ended."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)

    @property
    def code(self) -> str:
        """Of what was refused."""
        return self.err.strip().split("\n")[-1].partition(":")[0]


@pytest.fixture(autouse=True)
def config(tmp_path, monkeypatch):
    """A folder of settings of the test's own, and no pauses between two tries."""
    for name in (settings.SITE, settings.TOKEN):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(settings.FOLDER, str(tmp_path / "config"))
    monkeypatch.setattr(site_module, "RETRY_PAUSES_S", (0.0, 0.0))
    return tmp_path / "config"


@pytest.fixture
def paddock(capsys) -> Callable[..., Said]:
    """Call it: ``paddock("races", "--json")``."""

    def call(*arguments: object) -> Said:
        capsys.readouterr()
        status = main([str(one) for one in arguments])
        return Said(status, *capsys.readouterr())

    return call


@pytest.fixture
def site(live_server, wakes, monkeypatch, admitted_here):
    """The site's address; whoever waits for a run lets a worker have a turn. Uploads are converted in this process."""
    cache.clear()
    monkeypatch.setattr(asking.time, "sleep", lambda _: run_next_evaluation(worker="w"))
    monkeypatch.setenv("PADDOCK_SITE", live_server.url)
    return live_server.url


@pytest.fixture
def race(site):
    return a_race(timezone.now(), slug="open", laps=1, minimum_laps=1)


@pytest.fixture
def log_in(monkeypatch, paddock):
    """Log a racer in, as with a token from the settings of the site."""

    def do(alias: str, scopes: tuple[str, ...] = ("read", "race", "train")):
        racer = a_racer(alias)
        _, token = create_token(racer=racer, scopes=scopes, now=timezone.now())
        monkeypatch.setattr(sys, "stdin", io.StringIO(f"{token}\n"))
        assert paddock("login").status == 0
        return racer

    return do
