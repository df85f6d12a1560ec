"""Log lines as JSON, one object per record, where ``PADDOCK_LOG_FORMAT`` is ``json``."""

import io
import json
import logging
import os
import time
from collections.abc import Mapping, MutableMapping
from typing import Any, TextIO

from structlog.processors import JSONRenderer, StackInfoRenderer, format_exc_info
from structlog.stdlib import ProcessorFormatter

from .lines import NONE, job_id, moment, program_name, request_id, without_secrets


class JsonLines(ProcessorFormatter):
    """Formats a record as one line, whatever characters its text has: all others than ASCII are escaped."""

    def __init__(self) -> None:
        super().__init__(foreign_pre_chain=(StackInfoRenderer(), format_exc_info), processors=[_fields, JSONRenderer()])


def _fields(logger: object, method: str, event: MutableMapping[str, Any]) -> Mapping[str, object]:
    record: logging.LogRecord = event["_record"]
    fields = _line(record.created, record.levelname, record.name, event["event"], program_name(), record.process or 0)
    fields |= {"request_id": _known(request_id.get()), "job_id": _known(job_id.get())}
    traces = (str(event[name]) for name in ("exception", "stack") if name in event)
    exception = without_secrets("\n".join(traces))
    return fields | ({"exception": exception} if exception else {})


def line_of(text: str, program: str, process: int) -> str:
    """A printed line as a line of the log. One that is a line of the log already stays as it is."""
    if text.startswith('{"time": "'):
        try:
            json.loads(text)
        except ValueError:
            pass
        else:
            return text
    fields = _line(time.time(), "INFO", "output", text, program, process)
    return json.dumps(fields | {"request_id": None, "job_id": None})


class JsonOutput(io.TextIOBase):
    """A stream that writes each line as a line of the log."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._begun = out, ""

    def write(self, text: str) -> int:
        *lines, self._begun = (self._begun + text).split("\n")
        for line in lines:
            self._out.write(line_of(line, program_name(), os.getpid()) + "\n")
        return len(text)

    def flush(self) -> None:
        self._out.flush()


def _line(seconds: float, level: str, logger: str, message: str, program: str, process: int) -> dict[str, object]:
    return {
        "time": moment(seconds),
        "level": level.lower(),
        "logger": logger,
        "message": without_secrets(message),
        "program": program,
        "process": process,
    }


def _known(value: str) -> str | None:
    return None if value == NONE else value
