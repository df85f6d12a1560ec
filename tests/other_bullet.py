"""A Bullet that computes otherwise than the wheel: what another compiler or its flags may build."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.sandbox import start

MODULE = """
import importlib.machinery, importlib.util, math, os, sys

others = [path for path in sys.path if path != os.path.dirname(__file__)]
spec = importlib.machinery.PathFinder.find_spec("pybullet", others)
wheel = importlib.util.module_from_spec(spec)
spec.loader.exec_module(wheel)
told = wheel.getBasePositionAndOrientation

def getBasePositionAndOrientation(*arguments, **options):
    (x, y, z), turned = told(*arguments, **options)
    return (math.nextafter(x, math.inf), y, z), turned

wheel.getBasePositionAndOrientation = getBasePositionAndOrientation
sys.modules["pybullet"] = wheel
"""


def install_other_bullet(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on sandboxed processes import a Bullet whose positions are off by one unit in the last place."""
    folder.mkdir()
    (folder / "pybullet.py").write_text(MODULE)
    home = start._home()
    monkeypatch.setattr(start, "_home", lambda: replace(home, packages=(str(folder), *home.packages)))
