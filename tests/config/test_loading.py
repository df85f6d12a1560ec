"""What the run command loads before its programs, and what it leaves out."""

from __future__ import annotations

import gc
import os
import sys

import pytest

from config.operations import run

EXTRA, PACKAGE = "an_extra_for_terminals", "a_package_with_an_extra"


@pytest.fixture
def package(tmp_path, monkeypatch):
    (tmp_path / f"{EXTRA}.py").write_text("")
    (tmp_path / f"{PACKAGE}.py").write_text(
        f"try:\n    import {EXTRA} as extra\nexcept ImportError:\n    extra = None\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(run, "_WITH_EXTRAS", (PACKAGE,))
    monkeypatch.setattr(run, "_EXTRAS", (EXTRA,))
    yield PACKAGE
    for name in (EXTRA, PACKAGE):
        sys.modules.pop(name, None)


def test_an_extra_is_not_loaded_and_can_be_imported_later(package):
    run._load_without_extras()
    assert sys.modules[package].extra is None
    assert __import__(EXTRA) is sys.modules[EXTRA]


def test_an_extra_that_is_loaded_stays(package):
    loaded = __import__(EXTRA)
    run._load_without_extras()
    assert sys.modules[EXTRA] is loaded
    assert sys.modules[package].extra is loaded


def test_the_programs_collect_garbage_again():
    if (pid := os.fork()) == 0:
        gc.disable()
        run._share()
        os._exit(not gc.isenabled())
    assert os.waitpid(pid, 0)[1] == 0
