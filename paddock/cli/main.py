"""The entry point of the command line: it runs one command and returns its exit status."""

# Exit status 0: success. 1: the command ran, but the run failed or a hash differs. 2: refused, with the reason. 3: the
# site or Paddock failed, or there is nothing to compare. 130: interrupted.

from __future__ import annotations

import argparse
import gc
import io
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NoReturn

from paddock.errors import PaddockError, UserFault
from paddock.short_lived import leave

from .commands import parser
from .pinned import get_ready
from .showing import Speaker, one_line

if TYPE_CHECKING:
    from .asking import Call, Command

REFUSED, FAILED, INTERRUPTED = 2, 3, 130
_NOT_COMPARED = ("engine_differs", "result_not_there")
# Errors from an answer with parts of other types than a Paddock's
_STRANGE = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError)


def program() -> NoReturn:
    """The command as a program."""
    get_ready()
    leave(main())


def main(arguments: Sequence[str] | None = None) -> int:
    if arguments is None:
        gc.set_threshold(100_000)  # all that the parser and the imports make stays
    given = list(sys.argv[1:] if arguments is None else arguments)
    speaker = Speaker("--json" in given)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without the letters of a name is no failure
    try:
        options = parser("".join(given[:1])).parse_args(given)
        from .asking import Call

        return _called(Call(speaker, options.site), options)
    except BrokenPipeError:  # the reader closed the pipe
        sys.stderr.close()
        return 0
    except Exception as fault:  # all others go on
        from .site import SiteRefusal, error_of

        if not isinstance(fault, PaddockError | SiteRefusal):
            raise
        error = error_of(fault)
        if speaker.as_json:
            speaker.result({"error": error}, "")
        speaker.note(one_line(f"{error['code']}: {error['message']}"))
        return FAILED if error.get("fault") == "platform" or error["code"] in _NOT_COMPARED else REFUSED
    except KeyboardInterrupt:
        speaker.note("Interrupted. What was sent to the site goes on there.")
        return INTERRUPTED


def _called(asked: Call, options: argparse.Namespace) -> int:
    from pathlib import Path

    try:
        command = _command(options.run)
        if any(Path(name).is_dir() for name in getattr(options, "model", ())):
            from .folders import of_folder

            return of_folder(command, asked, options)
        return command(asked, options)
    except _STRANGE as error:
        if not asked.asked_site:
            raise
        described = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        problem = f"its answer is strange, {described}"
        raise UserFault("site_is_no_paddock", site=asked.asked_site, problem=problem) from error


def _command(name: str) -> Command:
    """The function of a command; only its module is loaded, so ``races`` needs no simulator."""
    module, _, function = name.partition(":")
    found: Command = getattr(import_module(f"{__package__}.{module}"), function)
    return found
