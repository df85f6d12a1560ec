"""Golden runs on other processors: in a bare process, and under qemu-user.

qemu-user runs the same process with the instructions of the named processor, computed in software.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from paddock import exact

from .drive import Driven
from .runs import GoldenRun

EMULATOR = "qemu-x86_64"  # Debian: qemu-user
NATIVE = "native"
# No AVX; AVX2 and FMA; AVX-512; another maker's AVX2
PROCESSORS = ("Nehalem", "Haswell", "Skylake-Server", "EPYC-Milan")
LIMIT_S = 600.0
BARE = "training.golden.bare_process"
_ROOT = Path(__file__).resolve().parent.parent.parent


class ProcessorFailed(Exception):
    """A processor did not complete the runs; the message names it and the cause."""


def emulator() -> str | None:
    return shutil.which(EMULATOR)


class Processor:
    """A bare process that drives ``runs`` on ``processor``: :data:`NATIVE`, or a name of ``qemu-x86_64 -cpu help``. It
    begins at once. ``module``: another program with the same input and output. Raises ProcessorFailed without an
    emulator."""

    def __init__(self, processor: str, runs: Sequence[GoldenRun], limit_s: float = LIMIT_S, module: str = BARE) -> None:
        self.name, self._limit_s = processor, limit_s
        command = [*_through(processor), str(Path(sys.executable).resolve()), "-m", module]
        with contextlib.ExitStack() as files, tempfile.TemporaryFile() as question:
            self._answers, self._errors = (files.enter_context(tempfile.TemporaryFile()) for _ in range(2))
            question.write(json.dumps([run.to_dict() for run in runs]).encode())
            question.seek(0)
            self._process = subprocess.Popen(
                command, stdin=question, stdout=self._answers, stderr=self._errors, env=_environment(), cwd=_ROOT
            )
            self._files = files.pop_all()

    def driven(self) -> list[Driven]:
        """The results in the order of the runs. Raises ProcessorFailed."""
        return [Driven.from_dict(answer) for answer in self.answers()]

    def answers(self) -> list[dict[str, object]]:
        """The lines that it printed. Raises ProcessorFailed."""
        try:
            status = self._process.wait(self._limit_s)
        except subprocess.TimeoutExpired:
            raise ProcessorFailed(f"{self.name}: not done after {self._limit_s:.0f} s") from None
        if status:
            output = _all_of(self._errors).decode(errors="replace").strip()[-2000:]
            raise ProcessorFailed(f"{self.name}: {_how(status)}: {output}")
        return [json.loads(line) for line in _all_of(self._answers).splitlines()]

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._files.close()


@contextlib.contextmanager
def side_by_side(
    processors: Sequence[str], runs: Sequence[GoldenRun], limit_s: float = LIMIT_S, module: str = BARE
) -> Iterator[list[Processor]]:
    """All of them at once, one process each; leaving the context ends them."""
    started: list[Processor] = []
    try:
        for name in processors:
            started.append(Processor(name, runs, limit_s, module))
        yield started
    finally:
        for one in started:
            one.close()


def _through(processor: str) -> list[str]:
    if processor == NATIVE:
        return []
    if (found := emulator()) is None:
        raise ProcessorFailed(f"{EMULATOR} is not installed (Debian: qemu-user)")
    return [found, "-cpu", processor]


def _environment() -> dict[str, str]:
    """Ours, with the pins, one thread, and a path to the packages, because the emulator knows no virtual
    environment."""
    packages = dict.fromkeys((sysconfig.get_path("platlib"), sysconfig.get_path("purelib")))
    ours = {"PYTHONPATH": os.pathsep.join([str(_ROOT), *packages]), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return exact.environment({**os.environ, **ours, "PYTHONDONTWRITEBYTECODE": "1", "ORT_DISABLE_TELEMETRY": "1"})


def _all_of(file: IO[bytes]) -> bytes:
    file.seek(0)
    return file.read()


def _how(status: int) -> str:
    if status == -signal.SIGILL:
        return "it lacks an instruction that Paddock needs (SIGILL)"
    return f"ended by {signal.Signals(-status).name}" if status < 0 else f"ended with {status}"
