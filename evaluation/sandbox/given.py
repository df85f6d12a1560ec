"""Memory in which a model's process finds its network, in place of reading it from a pipe.

The console's network is 23 MB: through a pipe they are copied twice and more, with a switch of process for every
megabyte. Here the launcher writes them once, and from then on nobody can: the memory is sealed before the process hears
of it, and the process holds a descriptor that is open for reading alone.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os

import numpy as np

from .shown import ReadableMemory, mapped

READY = 24 << 20  # bytes: one console network
_SEALS = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL


class Given(ReadableMemory):
    """The memory of one policy process, for one network. A host that has no such memory has pipes: see
    :func:`network_memory`."""

    def __init__(self) -> None:
        super().__init__("network", 0, 0)

    def get_ready(self) -> None:
        """Get the memory that a large network takes, while nobody waits for it: new pages take as long as the copy."""
        with contextlib.suppress(OSError):  # there is none to spare: so be it
            os.posix_fallocate(self.fd, 0, READY)

    def put(self, network: bytes) -> bool:
        """Write the network and seal it, once. False where it cannot be: the memory is then of no use any more."""
        left = memoryview(network)
        if not left:
            return False  # nothing cannot be mapped
        try:
            while left:  # what is too much stays: to give it back takes time, too
                left = left[os.pwrite(self.fd, left, len(network) - len(left)) :]
            fcntl.fcntl(self.fd, fcntl.F_ADD_SEALS, _SEALS)
        except OSError:
            return False
        return True


def network_memory() -> Given | None:
    """Memory for the network of a new policy process; None where this host has none."""
    with contextlib.suppress(OSError, AttributeError):
        return Given()
    return None


def taken(fd: int, size: int) -> memoryview:
    """The process's view of a network of so many bytes. Raises MemoryError, OSError."""
    try:
        return np.frombuffer(memoryview(mapped(fd, size, at_once=True)), np.uint8).data
    except OSError as error:
        if error.errno == errno.ENOMEM:
            raise MemoryError from error
        raise
