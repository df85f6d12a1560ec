"""Ends a process without the interpreter's own end, which frees every object one by one."""

import atexit
import os
import sys
from typing import NoReturn


def leave(status: int) -> NoReturn:
    """End this process with ``status``, after the functions of :mod:`atexit` and with all output written. The usual end
    takes up to a fifth of a short command's time; it still comes where the output cannot be written."""
    atexit._run_exitfuncs()
    try:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    except (AttributeError, OSError, ValueError):
        sys.exit(status)
    os._exit(status)
