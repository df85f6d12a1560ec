"""Writes down every package that is installed, to the version and the sha-256 of its files: ``make lock``.

    python scripts/lock.py     after a change of dependencies in pyproject.toml, or of a version in constraints.txt

``locks/run.txt``: what the site needs, and what builds it; ``test.txt``: that, and what the tests need;
``training.txt``: the first, and what training needs beside torch, whose builds differ by index; ``tools.txt``: what
locks and audits.
Each is for Linux on x86-64 and on AArch64. ``constraints.txt`` has the versions alone. What is locked stays at its
version; delete its line in ``constraints.txt`` to have the newest that pyproject.toml allows.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ROOT / "locks"
CONSTRAINTS = ROOT / "constraints.txt"
TOOLS = ["uv>=0.9", "pip-audit>=2.9"]
APART = "torch"
# what torch needs of Python on any machine: locked, though torch itself is not
OF_TORCH = ["filelock", "fsspec", "jinja2", "networkx", "sympy", "typing-extensions"]
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)")


def main() -> None:
    """Resolve all of them. Exits with the resolver's words where the wishes contradict each other."""
    wanted = wishes(tomllib.loads((ROOT / "pyproject.toml").read_text()))
    for name, wishes_of_one in wanted.items():
        _resolve(name, wishes_of_one)
    CONSTRAINTS.write_text(constraints(wanted))
    for name, wishes_of_one in wanted.items():
        path = LOCKS / f"{name}.txt"
        path.write_text(f"{heading(wishes_of_one)}\n{path.read_text()}")


def wishes(project: dict[str, Any]) -> dict[str, list[str]]:
    """What each lock is to satisfy, by its name, of a parsed pyproject.toml."""
    extras = project["project"]["optional-dependencies"]
    run = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    return {
        "run": run,
        "test": [*run, *extras["dev"]],
        "training": [*run, *extras["training"], *OF_TORCH],
        "tools": TOOLS,
    }


def heading(wishes_of_one: list[str]) -> str:
    """The first line of a lock: it is another when what it was made for is."""
    digest = hashlib.sha256(json.dumps(sorted(wishes_of_one)).encode()).hexdigest()
    return f"# Made by “make lock” for the dependencies {digest[:16]} of pyproject.toml"


def pins(lock: str) -> dict[str, set[str]]:
    """The versions that a lock names, by package."""
    found: dict[str, set[str]] = {}
    for line in lock.splitlines():
        if pin := _PIN.match(line):
            found.setdefault(pin[1], set()).add(pin[2])
    return found


def constraints(wanted: dict[str, list[str]]) -> str:
    """All versions of what runs, tests and trains, without hashes, and torch's."""
    lines = {wish for wish in wanted["training"] if wish.startswith(f"{APART}==")}
    for name in ("run", "test", "training"):
        for package, versions in pins((LOCKS / f"{name}.txt").read_text()).items():
            if len(versions) == 1:  # else they differ by Python's version, which the lock says and no plain pin can
                lines.add(f"{package}=={versions.copy().pop()}")
    return "".join(f"{line}\n" for line in sorted(lines, key=str.lower))


def _resolve(name: str, wishes_of_one: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        asked, without = Path(folder, "wishes.in"), Path(folder, "without.txt")
        asked.write_text("\n".join(wishes_of_one))
        without.write_text(f"{APART} ; sys_platform == 'none'\n")
        subprocess.run(
            [
                *("uv", "pip", "compile", asked, "--output-file", LOCKS / f"{name}.txt", "--quiet"),
                *("--universal", "--python-version", "3.11", "--generate-hashes", "--no-header", "--no-annotate"),
                *("--overrides", without, "--no-emit-package", APART),
                *([] if name == "tools" else ["--constraints", str(CONSTRAINTS)]),
            ],
            cwd=ROOT,
            check=True,
        )


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as failed:
        sys.exit(failed.returncode)
