"""Memory in which a referee shows a model what its car sees, in place of sending it through a pipe.

The referee writes; the model's process holds a descriptor that is open for reading only. The size is sealed. The
referee never reads this memory, so a stranger's network cannot send anything back through it.
"""

import contextlib
import ctypes
import fcntl
import mmap
import os
import weakref

from paddock.network.policy_wire import Buffer, PolicyHeader, observation_bytes

SIZE = 256 * 1024  # bytes; a pair of stereo cameras takes 38 kB of them
_SEALS = fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL
_FAILED = ctypes.c_void_p(-1).value
_AT_ONCE = getattr(mmap, "MAP_POPULATE", 0)


class ReadableMemory:
    """Memory that a model's process may read. ``fd`` is for the writer; ``reading_fd`` for that process, and closed
    here by :meth:`close_reading_end`. Raises OSError, AttributeError where this host has none."""

    def __init__(self, name: str, size: int, seals: int) -> None:
        self.fd = os.memfd_create(name, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        self.reading_fd = -1
        try:
            os.ftruncate(self.fd, size)
            fcntl.fcntl(self.fd, fcntl.F_ADD_SEALS, seals)
            os.fchmod(self.fd, 0o400)  # nobody else opens it again
            self.reading_fd = os.open(f"/proc/self/fd/{self.fd}", os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self.close()
            raise

    def close_reading_end(self) -> None:
        if self.reading_fd >= 0:
            os.close(self.reading_fd)
            self.reading_fd = -1

    def close(self) -> None:
        self.close_reading_end()
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1


class ObservationMemory(ReadableMemory):
    def __init__(self) -> None:
        super().__init__("observations", SIZE, _SEALS)


def create_observation_memory() -> ObservationMemory | None:
    """Memory for a new policy process; None where this host has none."""
    with contextlib.suppress(OSError, AttributeError):
        return ObservationMemory()
    return None


def map_for_writing(fd: int) -> Buffer | None:
    """The referee's view; None without a descriptor (-1). Raises OSError."""
    return map_memory(fd, SIZE, mmap.PROT_READ | mmap.PROT_WRITE) if fd >= 0 else None


def map_for_reading(fd: int) -> Buffer | None:
    """The model's view; None without a descriptor (-1). Raises OSError."""
    return map_memory(fd, SIZE) if fd >= 0 else None


def map_memory(fd: int, size: int, protection: int = mmap.PROT_READ, *, at_once: bool = False) -> Buffer:
    """Map memory until nothing refers to it. ``at_once``: all of it will be read. Raises OSError. (Python's own
    ``mmap`` copies the descriptor first, which a locked process may not.)"""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mmap.restype = ctypes.c_void_p
    libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    libc.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
    address = libc.mmap(None, size, protection, mmap.MAP_SHARED | (_AT_ONCE if at_once else 0), fd, 0)
    if address in (None, _FAILED):
        code = ctypes.get_errno()
        raise OSError(code, f"mmap: {os.strerror(code)}")
    memory = (ctypes.c_ubyte * size).from_address(address)
    weakref.finalize(memory, libc.munmap, address, size)
    return memory


def fits(header: PolicyHeader) -> bool:
    """Whether the observations of a header have room here; both ends must agree."""
    return observation_bytes(header) <= SIZE
