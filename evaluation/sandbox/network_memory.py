"""Sealed memory in which a model's process finds its network, in place of reading it from a pipe.

The console's network has 23 MB. The launcher writes them once and seals them; the process holds a descriptor that is
open for reading only.
"""

import contextlib
import errno
import fcntl
import os

import numpy as np

from .observation_memory import ReadableMemory, map_memory

READY = 24 << 20  # bytes: one console network
_SEALS = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL


class NetworkMemory(ReadableMemory):
    def __init__(self) -> None:
        super().__init__("network", 0, 0)

    def get_ready(self) -> None:
        """Allocate the memory of a large network ahead: new pages take as long as the copy."""
        with contextlib.suppress(OSError):  # there is none to spare: so be it
            os.posix_fallocate(self.fd, 0, READY)

    def put(self, network: bytes) -> bool:
        """Write the network and seal it, once. False where that fails: the memory is then useless."""
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


def create_network_memory() -> NetworkMemory | None:
    """Memory for the network of a new policy process; None where this host has none."""
    with contextlib.suppress(OSError, AttributeError):
        return NetworkMemory()
    return None


def map_network(fd: int, size: int) -> memoryview:
    """The process's view of a network of so many bytes. Raises MemoryError, OSError."""
    try:
        return np.frombuffer(memoryview(map_memory(fd, size, at_once=True)), np.uint8).data
    except OSError as error:
        if error.errno == errno.ENOMEM:
            raise MemoryError from error
        raise
