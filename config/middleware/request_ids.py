"""Gives every request an id for its answer and its lines in the log, and keeps it for the audit log."""

import re
import uuid
from collections.abc import Callable
from contextvars import Token

from django.http import HttpRequest, HttpResponse

from core.audit.acting import current_request
from core.logs.lines import request_id

HEADER = "X-Request-ID"
_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


class RequestIds:
    """Middleware: take the id that a proxy or client sent, where it is a plain word; else make one."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        begin(request.headers.get(HEADER, ""))
        current = current_request.set(request)
        try:
            response = self.get_response(request)
        finally:
            current_request.reset(current)
        response[HEADER] = request_id.get()
        return response


def begin(sent: str) -> Token[str]:
    """Begin a request. Its id stays that of its thread or task until the next one begins, also for streamed answers."""
    return request_id.set(sent if _SAFE.fullmatch(sent) else uuid.uuid4().hex)
