"""``scripts/system-packages.sh``: what must be there, what had better be, and who is told what."""

from __future__ import annotations

import subprocess

import pytest

from tests.shared import CHECKOUT

ALL = ("bwrap", "python3", "gcc")


@pytest.fixture
def run(tmp_path):
    """Call it where only these programs exist; apt-get, if any, writes down what it is asked for."""

    def call(*programs: str, root: bool, apt: str | None = "exit 0") -> tuple[int, str, str]:
        found = {program: "exit 0" for program in programs} | {"id": f"echo {0 if root else 1000}"}
        if apt is not None:
            found["apt-get"] = f'echo "$*" >> {tmp_path}/asked; {apt}'
        for name, body in found.items():
            (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
            (tmp_path / name).chmod(0o755)
        done = subprocess.run(
            ["/bin/sh", CHECKOUT / "scripts/system-packages.sh", "run"],
            env={"PATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=30,
        )
        asked = tmp_path / "asked"
        return done.returncode, done.stderr, asked.read_text() if asked.exists() else ""

    return call


@pytest.mark.parametrize("compiler", ["cc", "gcc", "clang"])
def test_nothing_is_installed_if_nothing_is_missing(run, compiler):
    assert run("bwrap", "python3", compiler, root=True) == (0, "", "")


def test_root_installs_what_is_missing_including_the_compiler(run):
    status, _, asked = run("python3", root=True)
    assert status == 0
    assert "bubblewrap" in asked and "gcc" in asked


def test_it_continues_if_no_compiler_can_be_installed(run):
    status, said, _ = run("bwrap", "python3", root=True, apt="exit 100")
    assert status == 0 and "goes on without: gcc" in said
    assert run("bwrap", "python3", root=False)[:2] == (
        0,
        "Paddock is faster with: gcc. Type: sudo apt-get install -y gcc\n",
    )


def test_it_continues_without_a_compiler_if_there_is_no_apt(run):
    assert run("bwrap", "python3", root=False, apt=None) == (0, "", "")


def test_it_stops_without_bubblewrap(run):
    status, said, _ = run("python3", "gcc", root=False)
    assert status == 1 and "sudo apt-get install -y bubblewrap\n" in said
    status, said, _ = run("python3", root=False, apt=None)
    assert status == 1 and "bubblewrap" in said and "gcc" not in said
    assert run("python3", "gcc", root=True, apt="exit 100")[0] != 0
