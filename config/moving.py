"""A page that asks for itself anew is not sent again while it is the same.

Pages of guests have a tag of their own (:mod:`config.guests`). A racer's page never reads the same twice: each has
another CSRF token, and the position up to which the stream has told. So these two are left out of its tag, and so is
the time that a live event's state says that it is.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable

from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response
from django.utils.http import quote_etag

ASKS = "X-Paddock-Parts"  # what moves.js sends
KNOWS = "X-Paddock-At"  # and, where the stream told it, up to which event the page knows that something moved
_NEVER_THE_SAME = re.compile(rb'(name="csrfmiddlewaretoken" value="|data-stream-at=")[^"]*')
_THE_TIME = re.compile(rb'"now": \d+, ')
Answer = Callable[[HttpRequest], HttpResponse]


def tag_of(content: bytes) -> str:
    """The ETag of a page."""
    always = _THE_TIME.sub(b"", content, count=1) if content.startswith(b"{") else _NEVER_THE_SAME.sub(b"", content)
    return quote_etag(hashlib.sha256(always).hexdigest()[:32])


class ChangedPages:
    """Middleware: an ETag for pages that ask for themselves anew, and 304 where that is what the reader has."""

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        response = self.get_response(request)
        if request.method != "GET" or ASKS not in request.headers or response.has_header("ETag"):
            return response
        if response.status_code != 200 or response.streaming:
            return response
        response["ETag"] = tag_of(response.content)
        return get_conditional_response(request, etag=response["ETag"], response=response) or response
