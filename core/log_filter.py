"""A filter of log handlers: links that carry a secret are written without it."""

from __future__ import annotations

import logging
import re

_SECRETS = re.compile(
    r"((?<![\w-])/(?:watch|join|laps|races/join|groups/join|teams/join|api/v1/invitations)/)[\w-]+", re.ASCII
)


class HidesTokens(logging.Filter):
    """Writes no token of an invitation, of a spectators' link or of a guest's laps."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Replace tokens in the message. Always True: every record is written."""
        try:
            message = record.getMessage()
        except (TypeError, ValueError):  # a faulty record: the handler reports it
            return True
        if _SECRETS.search(message):
            record.msg, record.args = _SECRETS.sub(r"\1…", message), ()
        return True


class WithoutRefusalTraces(logging.Filter):
    """A filter of log records: a refused request (4xx) is one line without a traceback."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Always true: the line itself stays."""
        if 400 <= getattr(record, "status_code", 0) < 500:
            record.exc_info = record.exc_text = None
        return True
