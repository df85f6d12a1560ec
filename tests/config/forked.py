"""A program for tests of the supervisor: says how it finds itself, until it is told to stop."""

from __future__ import annotations

import collections
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event, Thread
from time import sleep


def main() -> None:
    print(collections.loaded_here)
    print(", ".join(sys.argv[1:]))
    print(f"{signal.getsignal(signal.SIGINT).__name__}, {int(signal.getsignal(signal.SIGTERM))}, nice {os.nice(0)}")
    files = [int(one) for one in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{one}")]
    read = os.readlink("/proc/self/fd/0")
    print("files", ", ".join(f"{one} ({read})" if one == 0 else str(one) for one in sorted(files)))
    print(Path("/proc/self/cmdline").read_bytes().decode().rstrip("\0"))
    child = dict(line.split("=", 1) for line in subprocess.check_output(["env", "-0"], text=True).split("\0") if line)
    told = Event()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    Thread(target=_last_words, args=(told,)).start()
    collections.held = ThreadPoolExecutor(1)  # nobody shuts it down; it must not delay the end
    collections.held.submit(told.is_set)
    try:
        print("the environment is", "the same" if child == dict(os.environ) else "another")
        signal.pause()
    finally:
        told.set()


def _last_words(told: Event) -> None:
    """A program has ended when its threads have."""
    told.wait()
    sleep(0.2)
    print("stopped well")


if __name__ == "__main__":
    main()
