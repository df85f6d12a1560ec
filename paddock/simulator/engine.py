"""The id of the engine, which is stored with every result."""

import contextlib
import functools
import os
import sys

# Raise the number with any change that can move a lap time.
ENGINE_ID = "paddock-v3"


@functools.cache
def _versions() -> tuple[tuple[str, str], ...]:
    names = {"pybullet": "pybullet", "numpy": "numpy", "opencv": "opencv-python-headless"}
    return tuple((short, _version(name)) for short, name in names.items())


def _version(distribution: str) -> str:
    """The version of a distribution, from the name of its folder: importlib.metadata takes 15 ms to import."""
    prefix, suffix = distribution.replace("-", "_") + "-", ".dist-info"
    for folder in sys.path:
        with contextlib.suppress(OSError):
            for name in os.listdir(folder or "."):
                if name.startswith(prefix) and name.endswith(suffix):
                    return name[len(prefix) : -len(suffix)]
    from importlib import metadata

    return metadata.version(distribution)


def versions() -> dict[str, str]:
    """The versions of the libraries, the C library and Python on which a result depends."""
    import platform

    return {**dict(_versions()), "libc": _libc(), "python": platform.python_version()}


def _libc() -> str:
    try:
        return os.confstr("CS_GNU_LIBC_VERSION") or "unknown"
    except (AttributeError, ValueError, OSError):  # another C library, or none that tells
        return "unknown"


@functools.cache
def cpu_model() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    import platform

    return platform.processor() or platform.machine() or "unknown"
