"""Compiles and loads the engine's C functions."""

# They need a C compiler alone. ``pip install`` compiles them where it can (``setup.py``), and so do ``make`` and
# ``python -m paddock.simulator.compiled``. Without them Python does the same work more slowly, with the same result to
# the bit.

import ctypes
import functools
import hashlib
import os
import platform
import sys
from pathlib import Path

_HERE = Path(__file__).parent
SOURCES = (_HERE / "camera" / "warp.c", _HERE / "exchange.c", _HERE / "cruise.c")
LIBRARY = _HERE / f"native-{sys.platform}-{platform.machine()}.so"

_FLAGS = ["-O3", "-fwrapv", "-ffp-contract=off", "-fno-math-errno", "-ffreestanding", "-fPIC", "-shared"]
if sys.platform == "linux":
    _FLAGS.append("-nostdlib")
if platform.machine() in ("x86_64", "AMD64"):
    _FLAGS.append("-msse4.1")  # part of x86-64-v2, which numpy asks for too
_COMPILERS = ("cc", "gcc", "clang")
_PATIENCE_S = 60.0


def identity() -> str:
    """sha-256 (hex) of the sources and the flags. Raises OSError."""
    sources = b"".join(source.read_bytes() for source in SOURCES)
    return hashlib.sha256(sources + "\0".join(_FLAGS).encode()).hexdigest()


def load(library: Path = LIBRARY) -> ctypes.CDLL | None:
    """The library of these sources and flags, or None."""
    try:
        found = ctypes.CDLL(str(library))
        made_of = (ctypes.c_char * 65).in_dll(found, "paddock_identity").value.decode("ascii", "replace")
        return found if made_of == identity() else None
    except (OSError, ValueError):  # no such file, not a library of this system; no such symbol
        return None


@functools.cache
def library() -> ctypes.CDLL | None:
    """:func:`load`, once. In a sandbox: first before the lock."""
    return load()


def build(library: Path = LIBRARY) -> None:
    """Compile the sources. Raises OSError without a compiler or in a read-only folder, RuntimeError with the compiler's
    output."""
    import shutil
    import subprocess
    import tempfile

    compiler = os.environ.get("CC") or next(filter(None, map(shutil.which, _COMPILERS)), None)
    if compiler is None:
        raise OSError(f"no C compiler: none of {', '.join(_COMPILERS)}")
    with tempfile.TemporaryDirectory(dir=library.parent, prefix=".native-") as folder:
        made = Path(folder) / library.name
        sources = [str(source) for source in SOURCES]
        command = [*compiler.split(), *_FLAGS, f'-DIDENTITY="{identity()}"', "-o", str(made), *sources]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S)
        except subprocess.TimeoutExpired as error:
            raise RuntimeError(f"{compiler} did not end within {_PATIENCE_S:.0f} s") from error
        if done.returncode or load(made) is None:
            raise RuntimeError(f"{compiler} failed: {done.stderr.strip() or 'it made no library'}")
        made.chmod(0o755)
        os.replace(made, library)


def main() -> int:
    """Compile where the library is missing or outdated; the exit status."""
    if load() is None:
        try:
            build()
        except (OSError, RuntimeError) as error:
            print(f"Pictures are drawn slowly here: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
