"""Installs what training models needs, unless pip would fetch CUDA with it; then it says how to have it anyway.

    python scripts/offer_training.py        TRAINING=no leaves it out

torch as PyPI has it for Linux brings gigabytes of CUDA that nothing here uses, so pip is first asked what it would
fetch. Never fails: a site without training is a whole site.
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


def main() -> None:
    """Look, then install or tell."""
    if all(find_spec(name) for name in ("torch", "stable_baselines3")):
        return
    if os.environ.get("TRAINING", "").lower() == "no":
        print(LATER)
        return
    found = packages_to_fetch()
    if found is None:
        print(f"pip cannot tell what training needs. {LATER}")
        return
    if for_gpus := [name for name in found if name.lower().startswith(FOR_GPUS)]:
        print(f"Training would fetch {len(for_gpus)} packages of CUDA with torch (gigabytes). {LATER}")
        return
    print("Installing training")
    if _pip("install", "--quiet", "--editable", ".[training]").returncode:
        print(LATER)


def packages_to_fetch() -> list[str] | None:
    """Names of the packages that an installation of training would fetch; None where pip cannot tell."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        asked = _pip(
            "install", "--dry-run", "--quiet", "--report", str(report), "--editable", ".[training]", quiet=True
        )
        if asked.returncode:
            return None
        return [item["metadata"]["name"] for item in json.loads(report.read_text())["install"]]


def _pip(verb: str, *arguments: str, quiet: bool = False) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "pip", verb, "--constraint", "constraints.txt", *arguments]
    return subprocess.run(command, cwd=ROOT, stderr=subprocess.DEVNULL if quiet else None, check=False)


if __name__ == "__main__":
    main()
