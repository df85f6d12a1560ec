"""What every test of the sandbox needs: the levels this host offers, and proof that nothing is left behind."""

from __future__ import annotations

import contextlib
import ctypes
import os
from pathlib import Path

import pytest

from evaluation.sandbox.probe import probe
from evaluation.sandbox.start import LEVEL_LOCK, LEVEL_NAMESPACES

PR_SET_CHILD_SUBREAPER = 36
PAYLOADS = Path(__file__).parent / "payloads"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Without a sufficient sandbox nothing here can be tested, and that is not a failure of the code. What is marked
    ``any_level`` asks nothing of the wall: `make test` tries it at the level that workers use here, `make soak` at the
    others."""
    for item in items:
        level = getattr(item, "callspec", None) and item.callspec.params.get("level")
        if item.get_closest_marker("any_level") and level not in (None, probe().level):
            item.add_marker(pytest.mark.soak)
    if probe().level < LEVEL_LOCK:
        for item in items:
            if Path(item.fspath).parent == Path(__file__).parent and "level" in getattr(item, "fixturenames", ()):
                item.add_marker(pytest.mark.skip(reason=f"this host offers no sandbox:\n{probe().table()}"))


@pytest.fixture(params=[LEVEL_LOCK, LEVEL_NAMESPACES], ids=["lock", "namespaces"], scope="session")
def level(request: pytest.FixtureRequest) -> int:
    """Each level in turn that this host offers."""
    if probe().level < request.param:
        pytest.skip(f"this host offers sandbox level {probe().level} only")
    return request.param


def descendants() -> set[int]:
    """Every process below this one, ended ones that nobody waited for included."""
    children: dict[int, list[int]] = {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            parent = int(Path(f"/proc/{name}/stat").read_bytes().rpartition(b")")[2].split()[1])
            children.setdefault(parent, []).append(int(name))
    found, waiting = set(), [os.getpid()]
    while waiting:
        below = children.get(waiting.pop(), [])
        found.update(below)
        waiting += below
    return found


@pytest.fixture
def nothing_left():
    """Fails when the test leaves a process (running, detached or dead), or a descriptor."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)  # whoever detaches from its parent comes to us
    probe()
    processes, descriptors = descendants(), len(os.listdir("/proc/self/fd"))
    yield
    assert descendants() <= processes
    assert len(os.listdir("/proc/self/fd")) <= descriptors
