"""What a reward function may import, and having it there before the lock: afterwards no file can be opened."""

from __future__ import annotations

import contextlib
import importlib
import re
from collections.abc import Iterable

ALLOWED = ("math", "random", "numpy", "scipy", "shapely")

# numpy and scipy load their parts when they are first named, shapely most of them at once.
_PARTS = {
    "numpy": ("fft", "linalg", "ma", "polynomial", "random"),
    "scipy": (
        *("cluster", "constants", "fft", "integrate", "interpolate", "linalg", "ndimage", "optimize", "signal"),
        *("sparse", "spatial", "special", "stats"),
    ),
    "shapely": ("affinity", "geometry", "ops", "prepared", "validation", "wkt"),
}
# Parts of parts, which their own parents do not load.
_DEEPER = {
    "scipy.spatial.transform": ("scipy", "spatial", "transform"),
    "scipy.spatial.distance": ("scipy", "spatial", "distance"),
    "scipy.sparse.linalg": ("scipy", "sparse", "linalg"),
    "scipy.sparse.csgraph": ("scipy", "sparse", "csgraph"),
    "scipy.signal.windows": ("scipy", "signal", "windows"),
    "scipy.cluster.vq": ("scipy", "cluster", "vq"),
    "scipy.cluster.hierarchy": ("scipy", "cluster", "hierarchy"),
}
_WORD = re.compile(r"[A-Za-z_]\w*")


def wanted_modules(code: str) -> list[str]:
    """The modules that this code may need, by the words in it: it is not parsed, which is safe for nobody outside the
    sandbox. A word too many costs a little time at the start, nothing else. Only names of this file come out."""
    words = set(_WORD.findall(code))
    names = [name for name in ALLOWED if name in words]
    for package, parts in _PARTS.items():
        if package in words:
            names += [f"{package}.{part}" for part in parts if part in words]
    return names + [name for name, parts in _DEEPER.items() if words.issuperset(parts)]


def preload(names: Iterable[str]) -> None:
    """Import them, before the lock. What this installation lacks is left to fail where the code imports it."""
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
