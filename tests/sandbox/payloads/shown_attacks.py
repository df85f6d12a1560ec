"""What a model's process could try with the memory that it is shown: tells which attempts went through."""

import ctypes
import mmap
import os
import sys

from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.observation_memory import SIZE, map_for_reading

_F_ADD_SEALS, _F_DUPFD, _F_SETPIPE_SZ = 1033, 0, 1031
libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
libc.fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_long, ctypes.c_long]


def attempts(fd, address):
    """``address``: where it is mapped."""
    import fcntl

    both = mmap.PROT_READ | mmap.PROT_WRITE
    yield "map it to write", lambda: _done(libc.mmap(None, SIZE, both, mmap.MAP_SHARED, fd, 0) != 2**64 - 1)
    yield "write alone", lambda: _done(libc.mmap(None, SIZE, mmap.PROT_WRITE, mmap.MAP_SHARED, fd, 0) != 2**64 - 1)
    yield "make the view writable", lambda: _done(libc.mprotect(address, SIZE, both) == 0)
    yield "run it", lambda: _done(libc.mprotect(address, SIZE, mmap.PROT_READ | mmap.PROT_EXEC) == 0)
    yield "write to the descriptor", lambda: os.write(fd, b"x")
    yield "cut it off", lambda: os.ftruncate(fd, 0)
    yield "make it longer", lambda: os.ftruncate(fd, 2 * SIZE)
    yield "punch a hole", lambda: _done(libc.fallocate(fd, 3, 0, 4096) == 0)
    yield "seal it", lambda: fcntl.fcntl(fd, _F_ADD_SEALS, fcntl.F_SEAL_WRITE)
    yield "copy the descriptor", lambda: fcntl.fcntl(fd, _F_DUPFD, 0)
    yield "change its mode", lambda: os.fchmod(fd, 0o777)
    for where in ("/proc/self/fd", "/dev/fd"):
        yield f"open it again in {where}", lambda where=where: os.open(f"{where}/{fd}", os.O_RDWR)


def _done(went_through):
    if not went_through:
        raise OSError("refused")


def what_went_through(fd, address):
    """All attempts, as a message: how many, and which of them nobody refused."""
    tried, through = [], []
    for name, attempt in attempts(fd, address):
        tried.append(name)
        try:
            attempt()
        except OSError:
            continue
        through.append(name)
    return {"tried": len(tried), "through": through}


def main(frames_in, frames_out):
    fd = int(sys.argv[1])
    view = map_for_reading(fd)
    write_message(frames_out, what_went_through(fd, ctypes.addressof(view)) | {"sees": bytes(view[:8]).decode()})
    read_message(frames_in)
    write_message(frames_out, {"sees": bytes(view[:8]).decode()})
    return 0
