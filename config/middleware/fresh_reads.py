"""Chooses how old the shared parts of a page may be."""

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse

from core.streams.shared_pieces import reading_since

from .page_etags import ASKS, KNOWS

COOKIE = "wrote"  # in the browser of a reader who has just changed something
_SAFE = ("GET", "HEAD", "OPTIONS")


class FreshReads:
    """Middleware: the shared parts of a page that a reader opens are at most a second behind, but never behind what the
    reader has done.

    A successful unsafe request sets a cookie that lives a little longer than a shared part. With it, in the answer to
    an unsafe request, and in what a script or a program asks for, no part is older than the request. A page that
    follows the stream sends the position of the last event, and gets parts made after that.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        with reading_since(_seen(request)):
            response = self.get_response(request)
        if request.method not in _SAFE and response.status_code < 400 and "HTTP_AUTHORIZATION" not in request.META:
            response.set_cookie(
                COOKIE,
                "1",
                max_age=settings.SHARED_PAGE_SECONDS + 2,
                secure=settings.SESSION_COOKIE_SECURE,
                httponly=True,
                samesite="Lax",
            )
        return response


def _seen(request: HttpRequest) -> int | None:
    if request.method not in _SAFE or COOKIE in request.COOKIES:
        return None
    if "HTTP_AUTHORIZATION" in request.META or request.path.startswith("/api/"):
        return None
    sent = request.headers.get(KNOWS, "")
    if ASKS in request.headers and sent.isascii() and sent.isdecimal() and len(sent) < 19:
        return int(sent)
    is_opened = request.headers.get("Sec-Fetch-Mode", "navigate") == "navigate"
    return 0 if is_opened and "HX-Request" not in request.headers else None
