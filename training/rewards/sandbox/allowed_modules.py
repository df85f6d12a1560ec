"""Modules that a reward function may import; they are loaded before the lock.

Of the standard library: modules that only compute. Those with files, processes, threads, the network or internals of
the interpreter are refused: the sandbox would stop them during a training. ``time`` and ``datetime`` are those of
:mod:`.simulated_clock`; those that ``logging`` and ``calendar`` read are of the present call.
"""

import contextlib
import importlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import ModuleType
from typing import Any

from .simulated_clock import CLOCKS, PRESENT, EpisodeClock

LIBRARIES = ("math", "random", "numpy", "scipy", "shapely")  # those of the field
STANDARD = (
    *("abc", "array", "base64", "binascii", "bisect", "calendar", "cmath", "collections", "colorsys", "contextlib"),
    *("copy", "dataclasses", "datetime", "decimal", "difflib", "enum", "fractions", "functools", "graphlib", "hashlib"),
    *("heapq", "itertools", "json", "logging", "numbers", "operator", "pprint", "re", "reprlib", "statistics"),
    *("string", "struct", "textwrap", "time", "traceback", "typing", "unicodedata", "warnings", "weakref", "zlib"),
)
ALLOWED = (*LIBRARIES, *STANDARD)
# Parts of the standard library's packages that compute only; logging.handlers has files and the network.
_STANDARD_PARTS = ("collections.abc", "json.decoder", "json.encoder", "json.scanner")
_OTHER_PARTS = ("json.tool", "logging.config", "logging.handlers")

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
_DEEPER = (
    *("scipy.spatial.transform", "scipy.spatial.distance", "scipy.sparse.linalg", "scipy.sparse.csgraph"),
    *("scipy.signal.windows", "scipy.cluster.vq", "scipy.cluster.hierarchy"),
)
# What these import when they are first used.
_LATER = {"time": "_strptime", "datetime": "_strptime", "warnings": "linecache", "traceback": "linecache"}
_WORD = re.compile(r"[A-Za-z_]\w*")


def is_allowed(name: str) -> bool:
    """Whether a reward function may import the module of this dotted name."""
    package = name.split(".")[0]
    if package in STANDARD and package != name:
        return name in _STANDARD_PARTS
    return package in (*ALLOWED, "__future__")


def leak_in(names: Sequence[str]) -> str:
    """The forbidden module at the end of a dotted name such as ``logging.os``, or "". Knows only loaded modules."""
    dotted = ".".join(names)
    if dotted in _OTHER_PARTS:
        return dotted
    found: Any = sys.modules.get(names[0])
    for at, name in enumerate(names[1:], start=1):
        if not isinstance(found, ModuleType) or (at > 1 and not _may_be_reached(found, ".".join(names[:at]))):
            return ""
        found = vars(found).get(name)
    return "" if not isinstance(found, ModuleType) or _may_be_reached(found, dotted) else found.__name__


def _may_be_reached(module: ModuleType, dotted: str) -> bool:
    own = module.__name__
    return is_allowed(own) or is_allowed(own.removeprefix("_")) or (dotted in _STANDARD_PARTS)


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
    """The modules that this code may need, by the words in it; parsing is safe only inside the sandbox. A module too
    many costs a little time at the start. Only names of this file come out."""
    words = set(_WORD.findall(code))
    names = [name for name in ALLOWED if name in words]
    names += dict.fromkeys(later for name, later in _LATER.items() if name in words)
    for package, parts in _PARTS.items():
        if package in words:
            names += [f"{package}.{part}" for part in parts if part in words]
    return names + [name for name in _DEEPER if words.issuperset(name.split("."))]


def preload(names: Iterable[str]) -> None:
    """Import them, before the lock. What this installation lacks is left to fail where the code imports it."""
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
            if name in _PREPARED:
                _PREPARED[name](sys.modules[name])


def _use_present_clock(library: Any, name: str) -> None:
    """Let a module of the standard library read the clock of the present call."""
    setattr(library, name, PRESENT.module(name))


_PREPARED: dict[str, Callable[[Any], None]] = {
    "logging": lambda logging: _use_present_clock(logging, "time"),
    "calendar": lambda calendar: _use_present_clock(calendar, "datetime"),
}
