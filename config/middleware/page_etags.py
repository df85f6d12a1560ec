"""Adds an ETag to pages that poll for changes, and answers 304 while nothing has changed.

A racer's page has a new CSRF token and stream position in every answer, so the tag leaves out these two and the clock
of a live event. Pages of guests have another tag (:mod:`config.middleware.shared_pages`).
"""

import hashlib
import re

from django.http import HttpRequest, HttpResponse
from django.utils.cache import get_conditional_response
from django.utils.deprecation import MiddlewareMixin
from django.utils.http import quote_etag

ASKS = "X-Paddock-Parts"  # what live-page.js sends
KNOWS = "X-Paddock-At"  # the position of the last event that the page has read on the stream
_NEVER_THE_SAME = re.compile(rb'(name="csrfmiddlewaretoken" value="|data-stream-at=")[^"]*')
_THE_TIME = re.compile(rb'"now": \d+, ')


def tag_of(content: bytes) -> str:
    always = _THE_TIME.sub(b"", content, count=1) if content.startswith(b"{") else _NEVER_THE_SAME.sub(b"", content)
    return quote_etag(hashlib.sha256(always).hexdigest()[:32])


class PageETags(MiddlewareMixin):
    """Middleware: an ETag for pages that ask for themselves anew, and 304 where that is what the reader has."""

    def process_response(self, request: HttpRequest, response: HttpResponse) -> HttpResponse:
        if request.method != "GET" or ASKS not in request.headers or response.has_header("ETag"):
            return response
        if response.status_code != 200 or response.streaming:
            return response
        response["ETag"] = tag_of(response.content)
        return get_conditional_response(request, etag=response["ETag"], response=response) or response
