"""The first code in every sandboxed process: ``python -m evaluation.sandbox.enter IN OUT MODULE [ARGUMENT...]``.

Imports MODULE, locks the process and only then calls ``MODULE.main(IN, OUT)`` with the descriptors of its two pipes. A
module can therefore not forget to lock, and whatever it imports at its top is there before the lock. Descriptor 1 is
the same as 2 (captured stderr), so that no library's stray print lands among the frames. Exit status: what ``main``
returns (None: 0), or one of the ``EXIT_`` codes.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback

from .lock import EXIT_ERROR, EXIT_IMPORT, EXIT_MEMORY, EXIT_NOT_LOCKED, LockFailed, lock_down


def run(arguments: list[str]) -> int:
    """Enter the sandbox; returns the exit status."""
    frames_in, frames_out, module_name = int(arguments[0]), int(arguments[1]), arguments[2]
    os.dup2(2, 1)
    sys.argv = arguments[2:]
    try:
        module = importlib.import_module(module_name)
    except BaseException:
        traceback.print_exc()
        return EXIT_IMPORT
    try:
        lock_down()
    except LockFailed:
        traceback.print_exc()
        return EXIT_NOT_LOCKED
    try:
        return int(module.main(frames_in, frames_out) or 0)
    except MemoryError:
        return EXIT_MEMORY
    except BaseException:
        traceback.print_exc()
        return EXIT_ERROR


if __name__ == "__main__":
    # No interpreter shutdown: nothing to flush, and no extension module's exit handler meets the lock.
    os._exit(run(sys.argv[1:]))
