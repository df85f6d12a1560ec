"""What every test of the wall needs: the levels this host offers, and proof that nothing is left behind."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from evaluation.sandbox.launch import LEVEL_LOCK, LEVEL_NAMESPACES
from evaluation.sandbox.lock import VARIABLE
from evaluation.sandbox.probe import probe

PAYLOADS = Path(__file__).parent / "payloads"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Without a sufficient wall nothing here can be tested, and that is not a failure of the code."""
    if probe().level < LEVEL_LOCK:
        for item in items:
            if Path(item.fspath).parent == Path(__file__).parent and "level" in getattr(item, "fixturenames", ()):
                item.add_marker(pytest.mark.skip(reason=f"this host offers no wall:\n{probe().table()}"))


@pytest.fixture(params=[LEVEL_LOCK, LEVEL_NAMESPACES], ids=["lock", "namespaces"], scope="session")
def level(request: pytest.FixtureRequest) -> int:
    """Each level in turn that this host offers."""
    if probe().level < request.param:
        pytest.skip(f"this host offers sandbox level {probe().level} only")
    return request.param


def sandboxed_processes() -> set[int]:
    """Every process of this host that a launcher started (by its environment), however it was renamed or detached."""
    marker = f"{VARIABLE}=".encode()
    found = set()
    for name in os.listdir("/proc"):
        if name.isdigit() and int(name) != os.getpid():
            try:
                environment = Path(f"/proc/{name}/environ").read_bytes()
                ended = Path(f"/proc/{name}/stat").read_bytes().rpartition(b")")[2].split()[0] == b"Z"
            except OSError:
                continue
            if marker in environment or (ended and _parent(name) == os.getpid()):
                found.add(int(name))
    return found


def _parent(pid: str) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[1])
    except OSError:
        return 0


def _own(pids: set[int]) -> set[int]:
    """Those below this process: other test runs on the same host have their own."""
    own = set()
    for pid in pids:
        ancestor = pid
        while ancestor > 1:
            ancestor = _parent(str(ancestor))
            if ancestor == os.getpid():
                own.add(pid)
    return own


@pytest.fixture
def nothing_left():
    """Fails when the test leaves a sandboxed process (running or dead), or a descriptor."""
    probe()
    descriptors = set(os.listdir("/proc/self/fd"))
    orphans = {pid for pid in sandboxed_processes() if _parent(str(pid)) == 1}
    yield
    left = sandboxed_processes()
    assert not _own(left)
    assert {pid for pid in left if _parent(str(pid)) == 1} <= orphans
    assert len(os.listdir("/proc/self/fd")) <= len(descriptors)
