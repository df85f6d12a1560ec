"""The environment variables that make a process compute the same numbers on every x86-64 processor."""

# Libraries select their code by the processor. Code with fused multiply-add or wider vectors rounds differently or adds
# in another order. These variables select x86-64-v2 (of 2008) on every processor. Most of them are read once, before
# the first line of Python, so they belong into the environment of a new process: see :func:`start`.

import os
import sys
from collections.abc import Mapping, Sequence

PINS: Mapping[str, str] = {
    # libm (glibc 2.33 and newer): sine, arctangent and exponential have variants with fused multiply-add. The
    # simulator's results depend on this variable, a network's numbers on the others
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA4,-AVX",
    # OpenCV, which only draws grounds and solids: kernels for AVX2 fuse; what every processor has (SSE4.2) may stay
    "OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FMA3,AVX,FP16",
    # numpy: its own loops, named as numpy 2.4 names them, and its matrix products
    "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR",
    "OPENBLAS_CORETYPE": "Nehalem",
}
# Pages of 2 MB where the host grants them: fewer faults, and fewer looks into the tables of pages. A virtual machine
# may get them from its host more slowly than small ones, which counts where much memory is needed for a short time.
LARGE_PAGES = "glibc.malloc.hugetlb=1"
# glibc reuses freed memory: a network is copied several times when it is read, and getting new pages for every copy
# takes longer than the copies.
KEPT_MEMORY = "glibc.malloc.mmap_max=0:glibc.malloc.trim_threshold=2147483647:glibc.malloc.top_pad=33554432"
LARGE_AND_KEPT = f"{LARGE_PAGES}:{KEPT_MEMORY}"  # for a process that stays small


def environment(given: Mapping[str, str]) -> dict[str, str]:
    """``given`` with the pins; other tunables of glibc that it has are kept."""
    tunables = [part for part in given.get("GLIBC_TUNABLES", "").split(":") if part and ".hwcaps=" not in part]
    return {**given, **PINS, "GLIBC_TUNABLES": ":".join([*tunables, PINS["GLIBC_TUNABLES"]])}


def is_pinned(given: Mapping[str, str] = os.environ) -> bool:
    """Whether a process of this environment was started with the pins."""
    return all(value in given.get(name, "").split(":") for name, value in PINS.items())


def start(arguments: Sequence[str]) -> None:
    """Replace this process by a Python with the pins that runs ``arguments``: a script and its arguments, or ``-m`` and
    a module."""
    os.execve(sys.executable, [sys.executable, *arguments], environment(os.environ))


if __name__ == "__main__":
    start(sys.argv[1:])
