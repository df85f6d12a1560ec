"""What a reward function may import, and having it there before the lock: afterwards no file can be opened.

Of the standard library: modules that only compute. What gives files, processes, threads, the network or internals of
the interpreter (``os``, ``sys``, ``io``, ``pathlib``, ``subprocess``, ``threading``, ``socket``, ``pickle``, ...) is
refused: the sandbox would stop it in the midst of a training. ``time`` and ``datetime`` are those of :mod:`.clock`;
what ``logging`` and ``warnings`` write counts as printed.
"""

from __future__ import annotations

import contextlib
import importlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import ModuleType
from typing import Any

from .clock import CLOCKS, EpisodeClock
from .watch import watch

LIBRARIES = ("math", "random", "numpy", "scipy", "shapely")  # those of the field
STANDARD = (
    *("abc", "array", "base64", "binascii", "bisect", "calendar", "cmath", "collections", "colorsys", "contextlib"),
    *("copy", "dataclasses", "datetime", "decimal", "difflib", "enum", "fractions", "functools", "graphlib", "hashlib"),
    *("heapq", "itertools", "json", "logging", "numbers", "operator", "pprint", "re", "reprlib", "statistics"),
    *("string", "struct", "textwrap", "time", "traceback", "typing", "unicodedata", "warnings", "weakref", "zlib"),
)
ALLOWED = (*LIBRARIES, *STANDARD)
# Parts of the standard library's packages that compute only; logging.handlers has files and the network.
_STANDARD_PARTS = ("collections.abc", "json.decoder", "json.encoder")

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
# What these import when they are first used.
_LATER = {"time": "_strptime", "datetime": "_strptime", "warnings": "linecache", "traceback": "linecache"}
_WORD = re.compile(r"[A-Za-z_]\w*")


def is_allowed(name: str) -> bool:
    """Whether a reward function may import the module of this dotted name."""
    package = name.split(".")[0]
    if package in STANDARD and package != name:
        return name in _STANDARD_PARTS
    return package in (*ALLOWED, "__future__")


def importer(clock: EpisodeClock, original: Callable[..., Any]) -> Callable[..., Any]:
    """Python's ``__import__`` for a reward function's own lines: ``time`` and ``datetime`` are those of ``clock``."""

    def import_module(
        name: str,
        globals: Mapping[str, Any] | None = None,
        locals: Mapping[str, Any] | None = None,
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> ModuleType:
        if level == 0 and name in CLOCKS:
            return clock.module(name)
        return original(name, globals, locals, fromlist or (), level)

    return import_module


def wanted_modules(code: str) -> list[str]:
    """The modules that this code may need, by the words in it: it is not parsed, which is safe for nobody outside the
    sandbox. A word too many costs a little time at the start, nothing else. Only names of this file come out."""
    words = set(_WORD.findall(code))
    names = [name for name in ALLOWED if name in words]
    names += dict.fromkeys(later for name, later in _LATER.items() if name in words)
    for package, parts in _PARTS.items():
        if package in words:
            names += [f"{package}.{part}" for part in parts if part in words]
    return names + [name for name, parts in _DEEPER.items() if words.issuperset(parts)]


def preload(names: Iterable[str]) -> None:
    """Import them, before the lock. What this installation lacks is left to fail where the code imports it."""
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
            if name in _TO_PRINTS:
                _TO_PRINTS[name](sys.modules[name])


def _print_logs(logging: Any) -> None:
    """Handlers without a stream of their own print, and so does what no handler takes."""
    original = logging.StreamHandler.__init__

    def begin(handler: Any, stream: Any = None) -> None:
        original(handler, watch if stream is None else stream)

    logging.StreamHandler.__init__ = begin
    logging.lastResort = logging.StreamHandler()
    logging.lastResort.setLevel(logging.WARNING)


def _print_warnings(warnings: Any) -> None:
    original = warnings.showwarning

    def show(message: Any, category: Any, filename: str, lineno: int, file: Any = None, line: Any = None) -> None:
        original(message, category, filename, lineno, watch if file is None else file, line or "")

    warnings.showwarning = show


_TO_PRINTS: dict[str, Callable[[Any], None]] = {"logging": _print_logs, "warnings": _print_warnings}
