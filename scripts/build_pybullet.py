"""PyBullet's wheel for a Python that the package index has none for. It is compiled once and kept for all checkouts.

    python3.13 scripts/build_pybullet.py --state     published, built or missing; exit status 1 where it is missing
    python3.13 scripts/build_pybullet.py --build     compile it, unless a wheel exists
    python3.13 scripts/build_pybullet.py --install   the same, and install the wheel into the running Python
    python3.13 scripts/build_pybullet.py [FOLDER]    put the wheel into dist/ or FOLDER: the built one, else the index's

Everything is for the Python that runs the script; it needs no package. Wheels are kept in ``$XDG_CACHE_HOME``, by
default ``~/.cache``, under ``paddock/wheels``; the name has the versions and the machine. The source is the archive
whose sha-256 is in ``locks/run.txt``, built by the setuptools of the same lock.
"""

from __future__ import annotations

import argparse
import fcntl
import importlib.metadata
import importlib.util
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "paddock", "wheels")
DIST = ROOT / "dist"
VERSION = f"{sys.version_info[0]}.{sys.version_info[1]}"
PUBLISHED = ("3.11", "x86_64")  # the one Python and machine with a PyBullet wheel on the index
CPU_MINUTES = 11.5  # measured on one core
# The caller's are not taken: "-march=native", for example, would build a Bullet that rounds differently. On AArch64 GCC
# would by itself fuse multiply-add. Where CXXFLAGS is empty, setuptools compiles C++ without optimisation.
FLAGS = "-O3 -DNDEBUG -fwrapv -g0 -ffp-contract=off"
FREE_MB = 1500
EVERY_S = 20.0
_COUNT = (
    "import setuptools; from distutils.core import run_setup; "
    "found = run_setup('setup.py', stop_after='config').ext_modules; "
    "print('sources:', len({source for extension in found for source in extension.sources}))"
)
_BUILD = (
    "import runpy, sys, setuptools; sys.argv = ['setup.py', 'bdist_wheel', '-d', sys.argv[1]]; "
    "runpy.run_path('setup.py', run_name='__main__')"
)
_TRY = "import pybullet; pybullet.disconnect(pybullet.connect(pybullet.DIRECT))"


class BuildError(Exception):
    """The wheel cannot be built; the text is for the user."""


def locked(package: str) -> str:
    """The lines of ``locks/run.txt`` for a package: its version and hashes."""
    lock = (ROOT / "locks" / "run.txt").read_text()
    entry = re.search(rf"^{package}==\S+.*(?:\n    --hash=\S+.*)+\n", lock, re.M)
    assert entry, f"{package} is not locked"
    return entry[0]


def version() -> str:
    """The PyBullet that the site drives with."""
    return locked("pybullet").split()[0].partition("==")[2]


def is_published() -> bool:
    """Whether the package index has a wheel for this Python."""
    return (VERSION, platform.machine()) == PUBLISHED and platform.libc_ver()[0] == "glibc"


def find() -> Path | None:
    """The wheel for this Python that was built before, in the cache or in dist/."""
    tag = sysconfig.get_config_var("py_version_nodot") + getattr(sys, "abiflags", "")
    name = f"pybullet-{version()}-cp{sysconfig.get_config_var('py_version_nodot')}-cp{tag}-*_{platform.machine()}.whl"
    wheels = (wheel for folder in (CACHE, DIST) for wheel in sorted(folder.glob(name)))
    return next((wheel for wheel in wheels if zipfile.is_zipfile(wheel)), None)


def provide() -> Path:
    """The wheel, compiled where there is none. Raises BuildError."""
    if wheel := find():
        return wheel
    check()
    CACHE.mkdir(parents=True, exist_ok=True)
    with open(CACHE / f"pybullet-{version()}-{VERSION}.lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            print(f"Waiting for another build of PyBullet {version()}", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        if wheel := find():
            return wheel
        with _workplace(CACHE / f".pybullet-{version()}-{VERSION}") as place:
            return _compile(place)


def check() -> None:
    """Install the compiler and Python's headers where that is allowed. Raises BuildError where something is missing
    that the build would stop for minutes later."""
    if not all(importlib.util.find_spec(module) for module in ("ensurepip", "venv")):
        raise BuildError(
            f"{sys.executable} has no module venv, in which PyBullet is compiled; on Debian: sudo apt-get install -y "
            f"python{VERSION}-venv"
        )
    if not _compiles():
        _install_compiler()
    if not _compiles():
        headers = Path(sysconfig.get_paths()["include"], "Python.h")
        what = "a C++ compiler" if headers.exists() else f"a C++ compiler and the headers of this Python ({headers})"
        raise BuildError(
            f"PyBullet {version()} has no wheel for Python {VERSION} and cannot be compiled: install {what}, or Python "
            f"{PUBLISHED[0]}"
        )
    parent = next(folder for folder in (CACHE, *CACHE.parents) if folder.exists())
    if not os.access(parent, os.W_OK):
        raise BuildError(f"PyBullet's wheel cannot be kept in {CACHE}: name a writable folder with XDG_CACHE_HOME")
    free = shutil.disk_usage(parent).free / 1e6
    if free < FREE_MB:
        raise BuildError(
            f"Compiling PyBullet {version()} takes {FREE_MB} MB of disk and {parent} has {free:.0f} MB: free some, or "
            "name another folder with XDG_CACHE_HOME"
        )


def _compiler() -> dict[str, str]:
    """Environment of the compiler: Python's own compiler where it is installed, else g++."""
    python_uses = os.environ.get("CXX") or sysconfig.get_config_var("CXX") or "g++"
    found = {} if shutil.which(shlex.split(python_uses)[0]) else {"CC": "gcc", "CXX": "g++", "LDSHARED": "g++ -shared"}
    return {**os.environ, **found, "CFLAGS": FLAGS, "CXXFLAGS": FLAGS, "OMP_NUM_THREADS": "1"}


def _compiles() -> bool:
    environment = _compiler()
    compiler = shlex.split(environment.get("CXX") or sysconfig.get_config_var("CXX") or "g++")
    command = [*compiler, "-x", "c++", f"-I{sysconfig.get_paths()['include']}", "-fsyntax-only", "-"]
    source = "#include <vector>\n#include <Python.h>\n"
    try:
        done = subprocess.run(command, env=environment, input=source, capture_output=True, text=True)
    except OSError:
        return False
    return done.returncode == 0


def _install_compiler() -> None:
    """Call system-packages.sh, which installs as root. Otherwise it prints what to type, then the program ends."""
    of_the_system = sys.base_prefix == "/usr"
    headers = [f"python{VERSION}-dev"] if of_the_system else []
    if subprocess.run([ROOT / "scripts" / "system-packages.sh", "build", *headers]).returncode:
        sys.exit(1)


@contextmanager
def _workplace(place: Path) -> Iterator[Path]:
    """An empty folder beside the wheels; what a killed build left there is deleted first."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _tools(place: Path) -> tuple[str, ...]:
    """The pip of a new environment in this folder."""
    python = place / "env" / "bin" / "python"
    _run(sys.executable, "-m", "venv", str(place / "env"))
    return (str(python), "-m", "pip", "--disable-pip-version-check", "--retries", "2")


def _pip(pip: tuple[str, ...], verb: str, package: str, *options: str) -> None:
    """Install or download the locked files of a package. Raises BuildError."""
    listed = Path(pip[0]).parents[2] / f"{package}.txt"
    listed.write_text(locked(package))
    command = (*pip, verb, "--quiet", "--no-deps", "--require-hashes", *options, "--requirement", str(listed))
    try:
        _run(*command)
    except BuildError as error:
        raise BuildError(
            f"PyBullet {version()} has no wheel for Python {VERSION}, and {package}, which its build needs, could not "
            f"be downloaded: connect to pip's index, install Python {PUBLISHED[0]}, or copy the wheel of another "
            f"machine into {CACHE} ({str(error).splitlines()[-1]})"
        ) from error


def download(folder: Path) -> Path:
    """The wheel of the index, into a folder. Raises BuildError."""
    with tempfile.TemporaryDirectory(prefix="paddock-") as name:
        place = Path(name)
        _pip(_tools(place), "download", "pybullet", "--only-binary", ":all:", "--dest", name)
        (wheel,) = place.glob("*.whl")
        return _copy(wheel, folder)


def _copy(wheel: Path, folder: Path) -> Path:
    """Copy a wheel so that its name is never that of a part of it."""
    return Path(shutil.copy(wheel, folder / f".{wheel.name}")).replace(folder / wheel.name)


def _compile(place: Path) -> Path:
    """Compile in an empty folder, try the wheel and move it into the cache."""
    pip = _tools(place)
    python = pip[0]
    print(f"Downloading the source of PyBullet {version()} (80 MB)", flush=True)
    _pip(pip, "install", "setuptools")
    _pip(pip, "download", "pybullet", "--no-binary", "pybullet", "--no-build-isolation", "--dest", str(place))
    (archive,) = place.glob("pybullet-*.tar.gz")
    shutil.unpack_archive(archive, place)
    tree, made = place / archive.name.removesuffix(".tar.gz"), place / "made"
    _compile_tree(python, tree, made)
    (wheel,) = made.glob("*.whl")
    _run(*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel))
    _run(python, "-c", _TRY)
    return wheel.replace(CACHE / wheel.name)


def _compile_tree(python: str, tree: Path, made: Path) -> None:
    """Run PyBullet's setup.py; one line every few seconds has the number of compiled files."""
    made.mkdir()
    counted = re.search(r"^sources: (\d+)$", _run(python, "-c", _COUNT, cwd=tree), re.M)
    assert counted
    total, cores = int(counted[1]), os.cpu_count() or 1
    print(
        f"Compiling PyBullet {version()} for Python {VERSION}, once for all checkouts: {total} files, "
        f"about {max(1, round(CPU_MINUTES / cores))} minutes on {cores} idle cores",
        flush=True,
    )
    begun = time.monotonic()
    with open(made / "output.txt", "w+", errors="replace") as output:
        building = subprocess.Popen(
            [python, "-c", _BUILD, str(made)],
            cwd=tree,
            env=_compiler(),
            stdout=output,
            stderr=subprocess.STDOUT,
            process_group=0,
        )
        try:
            while not _ends(building):
                seconds, done = time.monotonic() - begun, len(list(tree.glob("build/**/*.o")))
                left = f", about {seconds * (total - done) / done / 60:.0f} min left" if done else ""
                print(f"  {done} of {total} files ({100 * done // total} %){left}", flush=True)
        finally:
            if building.poll() is None:  # interrupted
                os.killpg(building.pid, signal.SIGKILL)
                building.wait()
        if building.returncode:
            output.seek(0)
            words = "".join(output.readlines()[-15:])
            raise BuildError(f"PyBullet {version()} does not compile for Python {VERSION}:\n{words}")
    print(f"  compiled in {(time.monotonic() - begun) / 60:.1f} min", flush=True)


def _ends(process: subprocess.Popen[bytes]) -> bool:
    """Whether it ends within the next seconds."""
    try:
        process.wait(EVERY_S)
    except subprocess.TimeoutExpired:
        return False
    return True


def _run(*command: str, cwd: Path | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, errors="replace")
    if done.returncode:
        words = "\n".join((done.stdout + done.stderr).strip().split("\n")[-15:])
        raise BuildError(f"{' '.join(command[:4])} … failed:\n{words}")
    return done.stdout


def install() -> None:
    """Install the wheel into this environment, unless the index has one or it is installed. Raises BuildError."""
    if is_published() or _installed() == version():
        return
    wheel = provide()
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--force-reinstall")
    _run(*pip, str(wheel))
    try:
        _run(sys.executable, "-c", _TRY)
    except BuildError as error:
        print(f"{wheel} does not load here and is built anew: {str(error).splitlines()[-1]}", flush=True)
        wheel.unlink()
        _run(sys.executable, "-m", "pip", "uninstall", "--quiet", "--yes", "pybullet")
        install()


def _installed() -> str:
    try:
        return importlib.metadata.version("pybullet")
    except importlib.metadata.PackageNotFoundError:
        return ""


def main() -> int:
    """The command line. Exit status 1 where there is no wheel."""
    parser = argparse.ArgumentParser(description="Build PyBullet's wheel for this Python.")
    what = parser.add_mutually_exclusive_group()
    for option in ("state", "build", "install"):
        what.add_argument(f"--{option}", action="store_true")
    parser.add_argument("folder", nargs="?", type=Path, default=DIST, help="default: dist/")
    asked = parser.parse_args()
    if asked.state:
        state = "published" if is_published() else "built" if find() else "missing"
        print(state)
        return int(state == "missing")
    try:
        if asked.install:
            install()
        elif asked.build:
            provide()
        else:
            asked.folder.mkdir(parents=True, exist_ok=True)
            wheel = download(asked.folder) if is_published() else provide()
            if wheel.parent != asked.folder:
                wheel = _copy(wheel, asked.folder)
            print(f"{wheel}  {wheel.stat().st_size / 1e6:.1f} MB")
    except (OSError, BuildError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
