"""The servers that pages are measured on: they answer, or it is told that they do not."""

from __future__ import annotations

import urllib.request

import pytest

from benchmarks import load

pytestmark = pytest.mark.slow


def test_the_bare_site_answers():
    with load.server("benchmarks.bare") as (address, _), urllib.request.urlopen(address, timeout=30) as answer:
        assert answer.read() == b"hello"


def test_a_site_that_answers_nothing_is_no_server(monkeypatch, tmp_path):
    (tmp_path / "mute.py").write_text("application = None\nfrom django.conf import settings\nsettings.configure()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(load, "START_S", 6.0)
    with pytest.raises(load.LoadError, match="mute did not start"), load.server("mute"):
        pass
