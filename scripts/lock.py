"""Writes down every package that is installed, to the version and the sha-256 of its files: ``make lock``.

    python scripts/lock.py     after a change of dependencies in pyproject.toml, or of a version in constraints.txt

``locks/run.txt``: what the site needs, and what builds it; ``test.txt``: that, and what the tests need;
``training.txt``: the first, and what training needs beside torch; ``torch.sha256``: torch's builds for processors, as
its publisher's index states them; ``ldap.txt``: the first, and what log-in by LDAP needs; ``tools.txt``: what locks and
audits.
Each is for Linux on x86-64 and on AArch64 and for every Python of the classifiers in pyproject.toml: the lock fails
where a package has no wheel for one of them. ``constraints.txt`` has the versions alone. What is locked stays at its
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
from urllib.request import Request, urlopen

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ROOT / "locks"
CONSTRAINTS = ROOT / "constraints.txt"
TOOLS = ["uv>=0.9", "pip-audit>=2.9", "cyclonedx-bom>=7"]
APART = "torch"
BUILDS = LOCKS / "torch.sha256"
BUILDS_PAGE = "https://download.pytorch.org/whl/cpu/torch/"
# what torch needs of Python on any machine: locked, though torch itself is not
OF_TORCH = ["filelock", "fsspec", "jinja2", "networkx", "sympy", "typing-extensions"]
# built from source where there is no wheel: scripts/build_pybullet.py, make ldap
FROM_SOURCE = ("pybullet", "python-ldap")
MACHINES = {"x86-64": "x86_64-manylinux_2_36", "AArch64": "aarch64-manylinux_2_36"}  # glibc of Debian 12
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)")


def main() -> None:
    """Resolve all of them. Exits with the resolver's words where the wishes contradict each other or a wheel is
    missing."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = wishes(project)
    for name, wishes_of_one in wanted.items():
        _resolve(name, wishes_of_one)
        require_wheels((LOCKS / f"{name}.txt").read_text(), pythons(project))
    CONSTRAINTS.write_text(constraints(wanted))
    for name, wishes_of_one in wanted.items():
        path = LOCKS / f"{name}.txt"
        path.write_text(f"{heading(wishes_of_one)}\n{wheels(pythons(project))}\n{path.read_text()}")
    try:  # under another name than urllib's own, which the publisher refuses
        with urlopen(Request(BUILDS_PAGE, headers={"User-Agent": "Mozilla/5.0"}), timeout=30) as page:
            BUILDS.write_text(builds(page.read().decode(), CONSTRAINTS.read_text()) or BUILDS.read_text())
    except OSError as fault:
        print(f"locks/{BUILDS.name} stays as it is: {BUILDS_PAGE} is not reached ({fault})")


def builds(page: str, constraints: str) -> str:
    """Hash and name of each of torch's builds for processors that the page offers at the version of the constraints."""
    version = re.escape(next(iter(pins(constraints)[APART])))
    wheel = rf"torch-{version}\+cpu-(cp31[1-4])-\3-manylinux\w+_(?:x86_64|aarch64)\.whl"
    found = re.findall(rf"#sha256=([0-9a-f]{{64}})\"[^>]*>({wheel})<", page)
    return "".join(f"{digest}  {name}\n" for digest, name, _ in sorted(found, key=lambda one: one[1]))


def pythons(project: dict[str, Any]) -> list[str]:
    """The supported versions of Python, by the classifiers of a parsed pyproject.toml: ``["3.11", ...]``."""
    found = (
        re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", line) for line in project["project"]["classifiers"]
    )
    return [match[1] for match in found if match]


def wishes(project: dict[str, Any]) -> dict[str, list[str]]:
    """What each lock is to satisfy, by its name, of a parsed pyproject.toml."""
    extras = project["project"]["optional-dependencies"]
    run = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    return {
        "run": run,
        "test": [*run, *extras["dev"]],
        "training": [*run, *extras["training"], *OF_TORCH],
        "ldap": [*run, *extras["ldap"]],
        "tools": TOOLS,
    }


def heading(wishes_of_one: list[str]) -> str:
    """The first line of a lock: it is another when what it was made for is."""
    digest = hashlib.sha256(json.dumps(sorted(wishes_of_one)).encode()).hexdigest()
    return f"# Made by “make lock” for the dependencies {digest[:16]} of pyproject.toml"


def wheels(supported: list[str]) -> str:
    """The second line of a lock: for which Pythons :func:`require_wheels` found wheels."""
    sources = ", ".join(FROM_SOURCE)
    return f"# Wheels for Python {', '.join(supported)} on {' and '.join(MACHINES)}; from source: {sources}"


def require_wheels(lock: str, supported: list[str]) -> None:
    """Ask the index for a wheel of each locked package on every Python and machine. Raises CalledProcessError, after uv
    has printed the package that lacks one."""
    lines = (line.removesuffix("\\") for line in lock.splitlines() if _PIN.match(line))
    locked = "\n".join(line for line in lines if line.partition("==")[0] not in FROM_SOURCE)
    for python in supported:
        for platform in MACHINES.values():
            command = ["uv", "pip", "compile", "-", "--quiet", "--no-deps", "--only-binary", ":all:"]
            options = ["--python-version", python, "--python-platform", platform]
            subprocess.run([*command, *options], input=locked, text=True, stdout=subprocess.DEVNULL, check=True)


def pins(lock: str) -> dict[str, set[str]]:
    """The versions that a lock names, by package."""
    found: dict[str, set[str]] = {}
    for line in lock.splitlines():
        if pin := _PIN.match(line):
            found.setdefault(pin[1], set()).add(pin[2])
    return found


def constraints(wanted: dict[str, list[str]]) -> str:
    """All versions of what runs, tests, trains and asks LDAP, without hashes, and torch's."""
    lines = {wish for wish in wanted["training"] if wish.startswith(f"{APART}==")}
    for name in ("run", "test", "training", "ldap"):
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
