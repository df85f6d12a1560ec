"""The first code in every sandboxed process: :func:`run` with ``IN OUT MODULE [ARGUMENT...]`` as ``sys.argv[1:]``.

Imports MODULE, locks the process and then calls ``MODULE.main(IN, OUT)`` with the descriptors of its two pipes, so that
no module can forget to lock. Descriptor 1 is the same as 2 (captured stderr). Exit status: what ``main`` returns (None:
0), or one of the ``EXIT_`` codes.
"""

import gc
import importlib
import os
import sys

from .lock import EXIT_ERROR, EXIT_IMPORT, EXIT_MEMORY, EXIT_NOT_LOCKED, LockFailed, lock_down

COMMAND = "from evaluation.sandbox.enter import run; run()"


def run() -> None:
    """Enter the sandbox; does not return. No interpreter shutdown: no extension's exit handler shall meet the lock."""
    os._exit(_run(sys.argv[1:]))


def _run(arguments: list[str]) -> int:
    frames_in, frames_out, module_name = int(arguments[0]), int(arguments[1]), arguments[2]
    os.dup2(2, 1)
    sys.argv = arguments[2:]
    gc.disable()  # nothing that the imports make is garbage; looking for it costs a tenth of their time
    try:
        module = importlib.import_module(module_name)
    except BaseException as error:
        return _failed(error, EXIT_IMPORT)
    gc.freeze()
    gc.enable()
    try:
        lock_down()
    except LockFailed as error:
        return _failed(error, EXIT_NOT_LOCKED)
    try:
        return int(module.main(frames_in, frames_out) or 0)
    except MemoryError:
        return EXIT_MEMORY
    except BaseException as error:
        return _failed(error, EXIT_ERROR)


def _failed(error: BaseException, status: int) -> int:
    """Print the traceback to the captured stderr, as Python itself would (its ``traceback`` module is not loaded)."""
    sys.excepthook(type(error), error, error.__traceback__)
    return status
