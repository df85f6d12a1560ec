"""Memory in which a referee shows a model what its car sees, in place of sending it through a pipe.

The referee writes, the model's process reads: it holds a descriptor that is open for reading alone, which no call turns
into another one. The size is sealed. So nothing that a stranger's network does comes back this way, and the referee
never reads what lies here.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import mmap
import os
import weakref
from typing import Any

from paddock.network.policy_wire import Buffer, observation_bytes

SIZE = 256 * 1024  # bytes; a pair of stereo cameras takes 38 kB of them
_SEALS = fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL
_FAILED = ctypes.c_void_p(-1).value


class Shown:
    """The memory of one policy process. ``fd`` is for the referee; ``reading_fd`` for the model's process, and closed
    here by :meth:`handed_over`. A host that has no such memory has pipes: see :func:`shared_memory`."""

    def __init__(self) -> None:
        self.fd = os.memfd_create("observations", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        self.reading_fd = -1
        try:
            os.ftruncate(self.fd, SIZE)
            fcntl.fcntl(self.fd, fcntl.F_ADD_SEALS, _SEALS)
            os.fchmod(self.fd, 0o400)  # nobody else opens it again
            self.reading_fd = os.open(f"/proc/self/fd/{self.fd}", os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            self.close()
            raise

    def handed_over(self) -> None:
        """The model's process has its descriptor."""
        if self.reading_fd >= 0:
            os.close(self.reading_fd)
            self.reading_fd = -1

    def close(self) -> None:
        """Give the descriptors back. Does nothing the second time."""
        self.handed_over()
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1


def shared_memory() -> Shown | None:
    """Memory for a new policy process; None where this host has none."""
    with contextlib.suppress(OSError, AttributeError):
        return Shown()
    return None


def to_write(fd: int) -> Buffer | None:
    """The referee's view; None without a descriptor (-1). Raises OSError."""
    return _mapped(fd, mmap.PROT_READ | mmap.PROT_WRITE) if fd >= 0 else None


def to_read(fd: int) -> Buffer | None:
    """The model's view; None without a descriptor (-1). Raises OSError."""
    return _mapped(fd, mmap.PROT_READ) if fd >= 0 else None


def _mapped(fd: int, protection: int) -> Buffer:
    """Until nobody has it any more. Python's own ``mmap`` copies the descriptor first, which a locked process may
    not."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mmap.restype = ctypes.c_void_p
    libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    libc.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
    address = libc.mmap(None, SIZE, protection, mmap.MAP_SHARED, fd, 0)
    if address in (None, _FAILED):
        code = ctypes.get_errno()
        raise OSError(code, f"mmap: {os.strerror(code)}")
    memory = (ctypes.c_ubyte * SIZE).from_address(address)
    weakref.finalize(memory, libc.munmap, address, SIZE)
    return memory


def fits(header: dict[str, Any]) -> bool:
    """Whether the observations of a header have room here; both ends must agree."""
    return observation_bytes(header) <= SIZE
