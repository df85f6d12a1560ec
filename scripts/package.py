"""Builds the racers' package and the one of the original's module names: ``make package``.

    python scripts/package.py [FOLDER]     their wheels and source archives, in dist/ unless another folder is named

The engine is a part of the site's checkout and a distribution of its own. A project can have one pyproject.toml, so a
tree is put together for the second: ``paddock/`` as it is, the files of ``distribution/``, the licence, and the example
that ``paddock new`` hands out. Nothing else goes in. ``compat/`` is a separate project and only gets the licence.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "training" / "examples" / "train_a_car.py"
STARTER = Path("paddock", "cli", "starter")
_BUILD = "import sys; from setuptools import build_meta as b; to = sys.argv[1]; b.build_sdist(to); b.build_wheel(to)"
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "*.so", ".native-*")


def assemble(tree: Path) -> None:
    """Put the tree together, in a folder that is empty or not there."""
    shutil.copytree(ROOT / "distribution", tree, dirs_exist_ok=True)
    shutil.copytree(ROOT / "paddock", tree / "paddock", ignore=_LEFT_OUT)
    for path in (ROOT / "setup.py", ROOT / "LICENSE"):
        shutil.copy(path, tree)
    (tree / STARTER).mkdir(parents=True, exist_ok=True)
    shutil.copy(EXAMPLE, tree / STARTER)
    (tree / "MANIFEST.in").write_text("include *.pth setup.py\nrecursive-include paddock *\n")


def assemble_names(tree: Path) -> None:
    """The same for the module names ``deepracer`` and ``deepracer_gym``."""
    shutil.copytree(ROOT / "compat", tree, dirs_exist_ok=True, ignore=_LEFT_OUT)
    shutil.copy(ROOT / "LICENSE", tree)


PACKAGES: dict[str, Callable[[Path], None]] = {"paddock_racing": assemble, "paddock_deepracer": assemble_names}


def build(folder: Path, package: str = "paddock_racing") -> list[Path]:
    """Build wheel and source archive of one of :data:`PACKAGES` into ``folder``, in place of older ones; their paths.

    Raises RuntimeError with what the build said."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="paddock-racing-") as place:
        tree, made = Path(place, "tree"), Path(place, "made")
        made.mkdir()
        PACKAGES[package](tree)
        done = subprocess.run([sys.executable, "-c", _BUILD, str(made)], cwd=tree, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"the build failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        for old in folder.glob(f"{package}-*"):
            old.unlink()
        return [Path(shutil.copy(path, folder)) for path in sorted(made.iterdir())]


def main() -> int:
    """The command line. Exit status 1 where the build fails."""
    parser = argparse.ArgumentParser(description="Build the racers' packages.")
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "dist", help="default: dist/")
    try:
        folder = parser.parse_args().folder
        for path in (path for package in PACKAGES for path in build(folder, package)):
            print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")
    except (OSError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
