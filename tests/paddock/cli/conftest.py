"""The command, called in this process: what it says and its exit status."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from paddock.cli import settings
from paddock.cli.main import main


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
    """A folder of settings of the test's own."""
    for name in (settings.SITE, settings.TOKEN):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(settings.FOLDER, str(tmp_path / "config"))
    return tmp_path / "config"


@pytest.fixture
def paddock(capsys) -> Callable[..., Said]:
    """Call it: ``paddock("races", "--json")``."""

    def call(*arguments: object) -> Said:
        capsys.readouterr()
        status = main([str(one) for one in arguments])
        return Said(status, *capsys.readouterr())

    return call
