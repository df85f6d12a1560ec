"""Installs what training models needs: PyTorch's build for processors, and ``locks/training.txt``.

    python scripts/offer_training.py              before the site starts; TRAINING=no leaves training out
    python scripts/offer_training.py --always     “make training”: pip's own PyTorch where that build is not found

PyPI's torch for Linux depends on gigabytes of CUDA that nothing here uses. So only a file of ``locks/torch.sha256`` is
installed, checked by its hash: from an earlier download, from where pip is configured to look (a folder, a mirror), or
from the publisher's index (TORCH_INDEX= names another). Exit status 1: the next “make run” offers training again.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
import re
import shutil
import signal
import ssl
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from http.client import HTTPException, HTTPResponse
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import BinaryIO
from urllib.error import HTTPError
from urllib.parse import unquote, urljoin, urlsplit
from urllib.request import Request, urlopen

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "locks" / "torch.sha256"
INDEX = os.environ.get("TORCH_INDEX") or "https://download.pytorch.org/whl/cpu"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "paddock" / "wheels"
LOOK_S = 8  # the longest look at an index
STALLED_S = 60.0
EVERY_S = 5.0
LOCKED = ("--require-hashes", "--no-deps", "--requirement", "locks/training.txt")
UNPACKED = 4  # times the size of the wheel
MB = 1_000_000
STEP = f"[{os.environ['STEP']}/{os.environ['STEPS']}] " if {"STEP", "STEPS"} <= os.environ.keys() else ""
LATER = "The site runs without training models; “make training” adds it."


class LeftOutError(Exception):
    """Why training is left out. ``again``: the next “make run” offers it again."""

    def __init__(self, reason: str, *, again: bool = False) -> None:
        super().__init__(reason)
        self.again = again


def main() -> int:
    """Returns the exit status."""
    always = "--always" in sys.argv
    if not always and all(find_spec(name) for name in ("torch", "stable_baselines3")):
        return 0 if find_spec("optuna") or _pip(*LOCKED) else 1  # an older installation lacks it
    again = False
    if always or os.environ.get("TRAINING", "").lower() != "no":
        try:
            installed = install_build() or (always and _install_any())
            if installed and _pip(*LOCKED):
                return 0
        except LeftOutError as reason:
            print(reason)
            again = reason.again
        except KeyboardInterrupt:
            print("\nStopped. “make run” goes on with PyTorch; “make run TRAINING=no” starts the site without it.")
            return 130
    print(LATER)
    return int(always or again)


def install_build() -> bool:
    """Install the locked build of PyTorch from the first place that has it; False if none has it."""
    build = locked_build(LOCK.read_text())
    if build is None:
        print(f"No PyTorch is locked for Python {platform.python_version()} on {platform.machine()}.")
        return False
    name, digest = build
    refused = False
    with tempfile.TemporaryDirectory(dir=sys.prefix) as folder:
        for wheel in _wheels(name, Path(folder)):
            if sha256(wheel) == digest:
                _check_room(wheel.stat().st_size * UNPACKED)
                return _pip("--no-deps", "--no-index", str(wheel))
            print(f"Refused {wheel}: its SHA-256 is not that of locks/{LOCK.name}.")
            wheel.unlink()
            refused = True
    if refused:
        raise LeftOutError("PyTorch was not installed.")
    print(f"PyTorch's build for processors was not found ({name}).")
    return False


def locked_build(lock: str) -> tuple[str, str] | None:
    """Name and SHA-256 of the wheel for this Python and processor."""
    tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
    for line in lock.splitlines():
        digest, name = line.split()
        if f"-{tag}-{tag}-" in name and name.endswith(f"_{platform.machine()}.whl"):
            return name, digest
    return None


def sha256(file: Path) -> str:
    """The hash of a file's content."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _wheels(name: str, folder: Path) -> Iterator[Path]:
    """The wheel from each place that has it, the nearest first."""
    kept = CACHE / name
    if kept.exists():
        yield kept
    print(f"{STEP}Looking for PyTorch's build for processors (leave it out: make run TRAINING=no)", flush=True)
    quick = ["--no-deps", "--only-binary=:all:", "--retries", "0", "--timeout", str(LOOK_S)]
    command = [sys.executable, "-m", "pip", "download", *quick, "--dest", str(folder), "==".join(name.split("-")[:2])]
    if not subprocess.run(command, cwd=ROOT, stderr=subprocess.DEVNULL, check=False).returncode:
        yield from folder.iterdir()
    url = _look(name)
    if url and (wheel := _download(url, kept)):
        yield wheel


def _look(name: str) -> str | None:
    """The wheel's address on the publisher's index; None if the index is not reached in time or has no such file."""
    page = f"{INDEX.rstrip('/')}/torch/"
    signal.signal(signal.SIGALRM, _too_late)
    signal.alarm(LOOK_S)
    try:
        with _open(page, LOOK_S) as answer:
            links = re.findall(r'href="([^"]+)"', answer.read().decode())
    except (OSError, HTTPException):
        return None
    finally:
        signal.alarm(0)
    return next((urljoin(page, link) for link in links if Path(unquote(urlsplit(link).path)).name == name), None)


def _too_late(*_: object) -> None:
    raise TimeoutError


def _open(url: str, timeout: float, **headers: str) -> HTTPResponse:
    trusted = ssl.create_default_context(cafile=os.environ.get("PIP_CERT"))
    agent = {"User-Agent": "Mozilla/5.0 (compatible; Paddock)"}  # the publisher refuses urllib's own
    opened: HTTPResponse = urlopen(Request(url, headers=agent | headers), timeout=timeout, context=trusted)
    return opened


def _download(url: str, wheel: Path) -> Path | None:
    """Download the wheel, from where an earlier download broke off; None where that cannot begin."""
    part = wheel.with_name(f"{wheel.name}.part")
    try:
        wheel.parent.mkdir(parents=True, exist_ok=True)
        with part.open("ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with _open(url, STALLED_S, Range=f"bytes={file.tell()}-") as answer:
                if answer.status != 206:  # not the rest but the whole
                    file.truncate(0)
                _save(answer, file)
    except (OSError, HTTPException) as fault:
        print(f"{url} cannot be downloaded ({fault}).")
        if isinstance(fault, HTTPError):
            part.unlink()
        return None
    return part.rename(wheel)


def _save(answer: HTTPResponse, file: BinaryIO) -> None:
    """Append the answer to the file and print the progress."""
    got = file.seek(0, os.SEEK_END)
    total = got + int(answer.headers["Content-Length"])
    _check_room(total - got + total * UNPACKED)
    what = f"{STEP}Downloading {(total - got) / MB:.0f} MB of PyTorch"
    print(f"{what} (leave it out: make run TRAINING=no) ...", end="", flush=True)
    begun = printed = monotonic()
    fault: Exception = ConnectionError("the connection was closed")
    try:
        while chunk := answer.read(1 << 16):
            got += file.write(chunk)
            if monotonic() - printed >= EVERY_S:
                printed = monotonic()
                print(f" {got / MB:.0f} of {total / MB:.0f} MB ...", end="", flush=True)
    except (OSError, HTTPException) as error:
        fault = error
    print(f" {monotonic() - begun:.1f} s")
    if got < total:
        broken = f"The download of PyTorch broke off at {got / MB:.0f} of {total / MB:.0f} MB ({fault})"
        raise LeftOutError(f"{broken}; the next “make run” continues it.", again=True) from fault


def _check_room(size: int) -> None:
    """Raises :class:`LeftOutError` where so many bytes do not fit on the disk of the virtual environment."""
    free = shutil.disk_usage(sys.prefix).free
    if free < size:
        raise LeftOutError(f"PyTorch needs {size / MB:.0f} MB on the disk, and {free / MB:.0f} MB are free.")


def _install_any() -> bool:
    """Install what pip finds, at the version of constraints.txt. On Linux PyPI's build brings CUDA."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return _pip("--constraint", "constraints.txt", next(line for line in lines if line.startswith("torch==")))


def _pip(*arguments: str) -> bool:
    command = [sys.executable, "scripts/pip_progress.py", "install", *arguments]
    return subprocess.run(command, cwd=ROOT, check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main())
