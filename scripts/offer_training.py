"""Installs what training models needs, unless pip would fetch CUDA with it; then it says how to have it anyway.

    python scripts/offer_training.py              TRAINING=no leaves it out
    python scripts/offer_training.py --always     whatever its size; TORCH_INDEX= names the one index of torch's builds

torch as PyPI has it for Linux brings gigabytes of CUDA that nothing here uses, so pip is first asked what it would
fetch. Its builds differ by index, so torch alone is not locked by hash: it is taken from where pip is configured to
look, or from the index that is named and from no other. The rest is ``locks/training.txt``. Without ``--always`` it
never fails: a site without training is a whole site.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOR_GPUS = ("nvidia-", "cuda-", "triton")  # first letters of the packages that no processor needs
LATER = "The site runs without training models; “make training” adds it, whatever its size."
_WHERE_ELSE = ("PIP_INDEX_URL", "PIP_EXTRA_INDEX_URL", "PIP_FIND_LINKS", "PIP_NO_INDEX")


def main() -> int:
    """Look, then install or tell. The exit status: 1 only where training was asked for and cannot be installed."""
    if "--always" in sys.argv:
        return 0 if install(os.environ.get("TORCH_INDEX", "")) else 1
    if all(find_spec(name) for name in ("torch", "stable_baselines3")):
        return 0
    if os.environ.get("TRAINING", "").lower() == "no":
        print(LATER)
        return 0
    found = packages_to_fetch()
    if found is None:
        print(f"pip cannot tell what training needs. {LATER}")
    elif for_gpus := [name for name in found if name.lower().startswith(FOR_GPUS)]:
        print(f"Training would fetch {len(for_gpus)} packages of CUDA with torch (gigabytes). {LATER}")
    else:
        print("Installing training")
        if not install():
            print(LATER)
    return 0


def torch() -> str:
    """The version of torch, as a requirement."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return next(line for line in lines if line.startswith("torch=="))


def install(index: str = "") -> bool:
    """Install training. ``index``: the only place that torch's own build is taken from; what that needs beside it
    comes from where pip is configured to look. Whether all of it went well."""
    locked = ("--quiet", "--require-hashes", "--no-deps", "--requirement", "locks/training.txt")
    steps: list[tuple[tuple[str, ...], bool]] = [(locked, False)]
    if index:
        steps.append((("--quiet", "--no-deps", "--index-url", index, torch()), True))
    steps.append((("--quiet", "--constraint", "constraints.txt", torch()), False))
    return all(_pip("install", *arguments, only_here=only_here).returncode == 0 for arguments, only_here in steps)


def packages_to_fetch() -> list[str] | None:
    """Names of the packages that an installation of torch would fetch; None where pip cannot tell."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        dry = ("--dry-run", "--quiet", "--report", str(report))
        if _pip("install", *dry, "--constraint", "constraints.txt", torch(), quiet=True).returncode:
            return None
        return [item["metadata"]["name"] for item in json.loads(report.read_text())["install"]]


def _pip(
    verb: str, *arguments: str, quiet: bool = False, only_here: bool = False
) -> subprocess.CompletedProcess[bytes]:
    """``only_here``: without the places that the environment and pip's files name."""
    environment = dict(os.environ)
    if only_here:
        environment = {name: value for name, value in environment.items() if name not in _WHERE_ELSE}
        environment["PIP_CONFIG_FILE"] = os.devnull
    command = [sys.executable, "-m", "pip", verb, *arguments]
    return subprocess.run(command, cwd=ROOT, env=environment, stderr=subprocess.DEVNULL if quiet else None, check=False)


if __name__ == "__main__":
    sys.exit(main())
