"""Builds PyBullet's wheel from its source, for a Python that has none: everything but 3.11 on Linux.

    python3.11 scripts/build_pybullet.py /path/to/python3.12 [FOLDER]     into dist/ unless another folder is named

Needs pip's index (or pip's own settings for another one), a C++ compiler, the named Python with its headers and its
module venv, and some minutes of processor: hundreds of files of C++. The wheel is for that Python on this system; with
it, ``pip install --find-links FOLDER paddock_racing-....whl`` installs as for 3.11.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# PyBullet's setup.py imports distutils, which newer Pythons have from setuptools alone, and changes its compiler class
SETUPTOOLS = "setuptools<74"


def version() -> str:
    """The PyBullet that the site drives with."""
    wishes = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (found,) = (match[1] for wish in wishes if (match := re.fullmatch(r"pybullet==(\S+)", wish)))
    return str(found)


def build(python: str, folder: Path) -> Path:
    """The wheel. Raises RuntimeError with the last words of what failed."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="pybullet-") as place:
        environment = Path(place, "env")
        _run(python, "-m", "venv", str(environment))
        bin_folder = environment / ("Scripts" if sys.platform == "win32" else "bin")
        inside = str(bin_folder / "python")
        _run(inside, "-m", "pip", "install", "--quiet", SETUPTOOLS, "wheel")
        made = Path(place, "made")
        wanted = f"pybullet=={version()}"
        options = ["--no-deps", "--no-build-isolation", "--no-binary", "pybullet", "--no-cache-dir"]
        _run(inside, "-m", "pip", "wheel", *options, "--wheel-dir", str(made), wanted)
        (wheel,) = made.glob("*.whl")
        _run(inside, "-m", "pip", "install", "--quiet", "--no-deps", str(wheel))
        _run(inside, "-c", "import pybullet; pybullet.disconnect(pybullet.connect(pybullet.DIRECT))")
        target = folder / wheel.name
        target.write_bytes(wheel.read_bytes())
        return target


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        words = "\n".join((done.stdout + done.stderr).strip().split("\n")[-15:])
        raise RuntimeError(f"{' '.join(command[:4])} … failed:\n{words}")


def main() -> int:
    """The command line. Exit status 1 where it cannot be built."""
    parser = argparse.ArgumentParser(description="Build PyBullet for another Python.")
    parser.add_argument("python", help="the Python to build for")
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "dist", help="default: dist/")
    asked = parser.parse_args()
    began = time.monotonic()
    try:
        wheel = build(asked.python, asked.folder)
    except (OSError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{wheel}  {wheel.stat().st_size / 1e6:.1f} MB, {time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
