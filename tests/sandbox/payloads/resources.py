"""What a process in the sandbox does to the host's resources. ``sys.argv[1]`` names it."""

import contextlib
import fcntl
import os
import signal
import sys
import time

from evaluation.sandbox.frames import read_message, write_message

# At import, before the lock: as if the lock's ban on new processes had failed. Only the namespace can catch it.
if sys.argv[1] == "detach" and os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        while True:
            time.sleep(60)
    os._exit(0)


def grow_memory(_frames_in, _frames_out):
    held = []
    while True:
        held.append(bytearray(16 * 1024 * 1024))


def grow_memory_by_touching_one_block(_frames_in, _frames_out):
    bytearray(1 << 40)


def burn_processor_time(_frames_in, _frames_out):
    while True:
        pass


def flood_stderr(_frames_in, frames_out):
    block = b"x" * 1024 * 1024
    for _ in range(1024):
        with contextlib.suppress(BlockingIOError):
            os.write(2, block)
    write_message(frames_out, {"done": True})


def flood_stderr_for_ever(_frames_in, _frames_out):
    flags = fcntl.fcntl(2, fcntl.F_GETFL)
    fcntl.fcntl(2, fcntl.F_SETFL, flags & ~os.O_NONBLOCK)
    while True:
        os.write(2, b"x" * 65536)


def paint_the_terminal(_frames_in, _frames_out):
    os.write(2, b"\x1b]0;owned\x07\xff\nplain")


def ignore_signals(_frames_in, frames_out):
    for number in range(1, signal.NSIG):
        with contextlib.suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_IGN)
    write_message(frames_out, {"ready": True})
    while True:
        time.sleep(60)


def sleep(_frames_in, _frames_out):
    while True:
        time.sleep(60)


def detach(_frames_in, frames_out):
    write_message(frames_out, {"ready": True})
    while True:
        time.sleep(60)


def describe(_frames_in, frames_out):
    names = ("PATH", "HOME", "SECRET_KEY", "DATABASE_URL")
    write_message(
        frames_out,
        {
            "environment": sorted(os.environ),
            "leaked": [name for name in names if name in os.environ],
            "uid": os.getuid(),
            "gid": os.getgid(),
            "modules": [name for name in ("django", "celery", "torch") if name in sys.modules],
        },
    )


def end_with(_frames_in, _frames_out):
    os._exit(int(sys.argv[2]))


def echo(frames_in, frames_out):
    message, blobs = read_message(frames_in)
    write_message(frames_out, message, blobs)


def main(frames_in, frames_out):
    return globals()[sys.argv[1]](frames_in, frames_out)
