"""Base classes of the management commands: exit statuses, refusals and ``--json``."""

import json
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any, NoReturn, Self

from django.core.management.base import BaseCommand, CommandError, CommandParser, OutputWrapper
from django.db import DatabaseError, InterfaceError, OperationalError

from paddock.errors import PaddockError, PlatformFault, UserFault

_NO_TABLES = re.compile(r"relation .* does not exist|no such (table|column)|not a database")
REFUSED, OUR_FAULT = 2, 3


class Refusal(CommandError):
    """A command that fails. It prints the reason's code and its sentence on standard error, and the cause of a fault of
    ours. Its status is :data:`REFUSED` for the caller's fault and :data:`OUR_FAULT` for ours."""

    def __init__(self, fault: PaddockError) -> None:
        ours = not isinstance(fault, UserFault)
        why = f" ({fault.__cause__})" if ours and fault.__cause__ else ""
        super().__init__(f"{fault.code}: {fault}{why}", returncode=OUR_FAULT if ours else REFUSED)
        self.fault = fault

    @classmethod
    def unreadable(cls, error: OSError, path: object = None) -> Self:
        """For a file that cannot be read."""
        where = str(path or error.filename)
        return cls(UserFault("file_unreadable", path=where, problem=error.strerror or str(error)))


class JsonCommand(BaseCommand):
    """A command that a fault ends with a :class:`Refusal`; ``--json`` also prints it, as ``{"error": {"code", "params",
    "message"}}``."""

    def execute(self, *args: Any, **options: Any) -> str | None:
        try:
            return self._execute(*args, **options)
        except Refusal as refusal:
            if options.get("json"):
                self.stdout.write(error_json(refusal.fault))
            raise

    def _execute(self, *args: Any, **options: Any) -> str | None:
        try:
            return super().execute(*args, **options)
        except PaddockError as fault:
            raise Refusal(fault) from fault
        except DatabaseError as error:
            unready = None if options.get("traceback") else database_fault(error)
            if unready is None:
                raise
            raise Refusal(unready) from error

    def create_parser(self, prog_name: str, subcommand: str, **kwargs: Any) -> CommandParser:
        parser = super().create_parser(prog_name, subcommand, **kwargs)
        usual: Callable[[str], NoReturn] = parser.error

        def error(message: str) -> NoReturn:
            if getattr(self, "_called_from_command_line", False) and "--json" in sys.argv:
                self.stdout.write(error_json(UserFault("command_line", problem=message)))
            usual(message)

        parser.error = error  # type: ignore[method-assign]
        return parser

    @contextmanager
    def exit_on_fault(self, *, as_json: bool, verbosity: int = 1) -> Iterator[None]:
        """End the command at a fault, after its code, sentence and notes, and at an interrupt (130)."""
        try:
            yield
        except PaddockError as fault:
            if as_json:
                self.stdout.write(error_json(fault))
            ours = not isinstance(fault, UserFault)
            for note in getattr(fault, "__notes__", ()) if ours or verbosity > 1 else ():
                self.stderr.write(note)
            self.stderr.write(f"{fault.code}: {fault}")
            sys.exit(OUR_FAULT if ours else REFUSED)
        except KeyboardInterrupt:
            sys.exit(130)


def database_fault(error: Exception) -> PlatformFault | None:
    """The fault of a database that is missing, has no tables or is none; None for any other exception."""
    unready = isinstance(error, OperationalError | InterfaceError) or (
        isinstance(error, DatabaseError) and _NO_TABLES.search(str(error)) is not None
    )
    problem = " ".join(str(error).split())[:200].rstrip(".?")
    return PlatformFault("database_not_ready", problem=problem) if unready else None


def error_json(fault: PaddockError) -> str:
    """A refusal as ``--json`` prints it."""
    return json.dumps({"error": {**fault.to_dict(), "message": str(fault)}}, indent=2)


class Ticker:
    """Tells how far something is: the first time at once, then once a second; nothing where it is quiet."""

    def __init__(self, out: OutputWrapper, quiet: bool = False, every_s: float = 1.0) -> None:
        self._out, self._quiet, self._every_s = out, quiet, every_s
        self._next, self._subject = 0.0, ""

    def __call__(self, text: str) -> None:
        subject = text.partition(":")[0]
        if not self._quiet and (subject != self._subject or monotonic() >= self._next):
            self._out.write(text)
            self._next, self._subject = monotonic() + self._every_s, subject


@contextmanager
def ended_in_good_order() -> Iterator[None]:
    """On SIGTERM, the command cleans up before it ends."""

    def end(number: int, frame: object) -> NoReturn:
        sys.exit(128 + number)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
