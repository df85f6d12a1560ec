"""Refuses, with what to do, a Python in which the physics engine is not installed."""

import sys
from importlib.util import find_spec


def without_physics() -> str:
    """What to do where PyBullet is missing."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    return (
        f"PyBullet, the physics engine of deepracer-v0, is not installed for this Python {version}. On PyPI it has a "
        "wheel for Python 3.11 on Linux x86-64 alone. Either use Python 3.11 (uv venv --python 3.11), or take the "
        f"wheel for Python {version} from a release of Paddock or from your teacher (in a checkout "
        f"make wheels PYTHON=python{version} builds it) and name its folder: "
        "pip install --find-links FOLDER paddock-racing. Neither needs a compiler. On Windows use WSL, on macOS a "
        "container."
    )


if find_spec("pybullet") is None:
    raise ImportError(without_physics(), name="pybullet")
