"""The format of log lines, without e-mail addresses, passwords and tokens. Loads the standard library only."""

import logging
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path

NONE = "-"
FORMATTERS = {"plain": "core.logs.lines.LogLines", "json": "core.logs.json_lines.JsonLines"}
request_id: ContextVar[str] = ContextVar("request_id", default=NONE)
job_id: ContextVar[str] = ContextVar("job_id", default=NONE)

_TOKENS = re.compile(
    r"((?<![\w-])/(?:watch|join|laps|class|races/join|races/invited|groups/join|teams/join|notices/stop"
    r"|invitations/stop|api/v1/invitations|api/v1/(?:auth|programs/[\w-]+)/tokens|settings/tokens|accounts/confirm-email"
    r"|accounts/password/reset/key)/)[\w:.%=-]+"
)
_QUERIES = re.compile(r"([?&](?:token|key|code|secret|password|signature)=)[^&\s\"'<>]+", re.IGNORECASE)
_PASSWORDS = re.compile(r"(\w://)[^\s/@]*@")
# Celery names its workers in the same form
_ADDRESSES = re.compile(r"(?<![\w.+%-])(?!(?:celery|trainer|messenger|video-worker)@)[\w.+%'-]+@[\w-]+(?:\.[\w-]+)+")
_INVISIBLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069]")


def format_name() -> str:
    """The name of the log's format, for programs that have not loaded the settings."""
    name = os.environ.get("PADDOCK_LOG_FORMAT", "plain")
    return name if name in FORMATTERS else "plain"


def as_printed(text: str, program: str = "", process: int = 0) -> str:
    """A line that a program prints without the log: as it is, or a line of a log in JSON."""
    if format_name() != "json":
        return text
    from .json_lines import line_of  # loads a library

    return line_of(text, program or program_name(), process or os.getpid())


class LogLines(logging.Formatter):
    """Formats a record as one line, or several of the same beginning."""

    def format(self, record: logging.LogRecord) -> str:
        first, *more = without_secrets(super().format(record)).split("\n")
        begin = beginning(record.created, record.process or 0)
        lines = [f"{begin} {record.levelname:.1} {record.name} {first}", *(f"{begin}   {line}" for line in more)]
        return "\n".join(
            _INVISIBLE.sub(lambda found: found[0].encode("unicode_escape").decode(), line) for line in lines
        )


def beginning(seconds: float, process: int, program: str = "") -> str:
    """What each line of the log begins with: time (UTC), program, process and request."""
    return f"{moment(seconds)} {program or program_name()}[{process}] {request_id.get()}"


def current_request() -> str:
    """The id of the request or task at hand, or ``""``."""
    return "" if request_id.get() == NONE else request_id.get()


@contextmanager
def job_in_log(name: str, request: str) -> Iterator[None]:
    """Have the lines of a block name this job, and the request that queued it (``""``: unknown)."""
    of_job, of_request = job_id.set(name), request_id.set(request or request_id.get())
    try:
        yield
    finally:
        job_id.reset(of_job)
        request_id.reset(of_request)


def moment(seconds: float) -> str:
    """A time in UTC, by ISO 8601."""
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(seconds))}.{int(seconds % 1 * 1000):03}Z"


def without_secrets(text: str) -> str:
    """A text for the log, without e-mail addresses, passwords and tokens."""
    text = _PASSWORDS.sub(r"\1…@", text)
    for pattern in (_TOKENS, _QUERIES):
        text = pattern.sub(r"\1…", text)
    return _ADDRESSES.sub("…@…", text)


def program_name() -> str:
    """The name of this program."""
    return program_of(tuple(sys.argv))


@lru_cache(maxsize=8)
def program_of(arguments: tuple[str, ...]) -> str:
    """The name of a program by its command line, as ``manage.py run`` names it."""
    at = Path(arguments[0] if arguments else "python")
    name = at.parent.name if at.stem == "__main__" else at.stem
    if name == "manage":
        return next((word for word in arguments[1:] if not word.startswith("-")), name)
    if name != "celery":
        return name
    words = " ".join(arguments)
    host = re.search(r"(?:--hostname|-n)[ =]([\w-]+)@", words)
    return host[1] if host else next((word for word in ("beat", "worker") if word in arguments), name)
