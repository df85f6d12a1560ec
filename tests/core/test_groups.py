"""How tests are dealt out: a group runs in one process (tests/groups.py), else each process makes anew what they
share; and journeys read only the files that name a slow test."""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests import conftest
from tests.shared import CHECKOUT


@pytest.mark.xdist_group("together")
@pytest.mark.parametrize("number", range(6))
def test_a_group_runs_in_one_process(number):
    processes = Path(os.environ["PADDOCK_TEST_DATA"], "together")
    processes.mkdir(exist_ok=True)
    (processes / str(os.getpid())).touch()
    assert len(list(processes.iterdir())) == 1


def test_journeys_read_only_files_that_name_the_mark(pytestconfig, monkeypatch, tmp_path):
    assert f'-m "{conftest.JOURNEYS}"' in (CHECKOUT / "Makefile").read_text()
    files = {"test_quick.py": "def test_a(): ...", "test_slow.py": "pytestmark = pytest.mark.slow", "rows.py": ""}
    files |= {"test_browser.py": "pytestmark = IN_A_BROWSER", "test_slower.py": "def test_slower_cars(): ..."}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    for marks, left_out in ((conftest.JOURNEYS, {"test_quick.py", "test_slower.py"}), ("not soak", set())):
        monkeypatch.setattr(pytestconfig.option, "markexpr", marks)
        assert {name for name in files if conftest.pytest_ignore_collect(tmp_path / name, pytestconfig)} == left_out


@pytest.mark.parametrize(("mark", "is_refused"), [("slow", True), ("soak", False)])
def test_a_file_with_a_slow_test_that_does_not_name_the_mark_is_refused(mark, is_refused, request, monkeypatch):
    monkeypatch.setattr(conftest, "_names_slow", lambda file: False)
    of_the_file = getattr(pytest.mark, mark).mark
    monkeypatch.setattr(request.node, "iter_markers", lambda name=mark: [of_the_file] if name == mark else [])
    monkeypatch.setattr(request.node, "get_closest_marker", lambda name: None)
    with pytest.raises(pytest.UsageError, match="journeys would not find") if is_refused else nullcontext():
        conftest.pytest_collection_modifyitems(request.config, [request.node])
