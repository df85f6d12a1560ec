"""A process that has loaded the site and does commands as ``manage.py`` does them, each in a fork of its own.

On stdin: lines of JSON, ``[arguments, file for standard output, file for standard error]``. On stdout, for each: the
exit status. Loading takes two seconds of a processor, a fork hundredths of one.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent.parent


def main() -> None:
    sys.path[0] = str(CHECKOUT)  # as where manage.py stands
    os.environ["DJANGO_SETTINGS_MODULE"] = "config.settings"
    import django
    from django.urls import get_resolver

    from config.serving.forking import fork

    django.setup()
    assert get_resolver().url_patterns
    assert threading.active_count() == 1, "a fork goes on with one thread only"
    for line in sys.stdin:
        pid, output = fork(partial(_command, *json.loads(line)))
        os.close(output)
        print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)


def _command(arguments: Sequence[str], out: str, err: str) -> None:
    from config.serving.forking import PYTHON, become

    for number, path in ((0, os.devnull), (1, out), (2, err)):
        opened = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    become([*PYTHON, "manage", *arguments])


if __name__ == "__main__":
    main()
