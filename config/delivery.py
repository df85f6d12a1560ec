"""How answers for programs travel: who may read them from elsewhere, how long they are fresh, and how small they are.

Pages are left alone. Each has a CSRF token of its own, which is never the same twice and which nobody may measure by
what it compresses to (BREACH); nor is an answer compressed that a cookie was sent for.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from django.conf import settings
from django.http import FileResponse, HttpRequest, HttpResponse, HttpResponseBase
from django.middleware.gzip import GZipMiddleware
from django.middleware.http import ConditionalGetMiddleware
from django.utils.cache import patch_vary_headers
from django.utils.http import quote_etag

from races.spectators import is_spectator

READS = ("GET", "HEAD")
COMPRESSED = (
    *("application/json", "application/vnd.oai.openapi", "application/vnd.oai.openapi+json", "application/yaml"),
    *("application/atom+xml", "text/csv", "text/calendar", "text/plain", "image/svg+xml"),
)
# Both are asked for again, and answered 304 while they are the same.
OPEN, OWN = "public, no-cache", "private, no-cache"
_LIMITS = ("RateLimit-Limit", "RateLimit-Remaining", "RateLimit-Reset", "Retry-After")
_PREFLIGHT_S = 86_400
_ALLOWED_HEADERS = ("Accept", "Accept-Language", "Authorization", "If-None-Match")
_SEEN_HEADERS = ("Content-Disposition", "ETag", *_LIMITS)

Answer = Callable[[HttpRequest], HttpResponse]


class PublicReads:
    """Middleware: what the API and the files beside pages say may be read by a script of any site (CORS).

    Only what anybody could read without a browser: no cookie goes along (``*`` forbids it), so a reader's session opens
    nothing; a token must be sent by whoever holds it. Off with PADDOCK_CORS=False.
    """

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not settings.CORS or "Origin" not in request.headers:
            return self.get_response(request)
        asked = request.headers.get("Access-Control-Request-Method")
        if request.method == "OPTIONS" and asked is not None:
            return _preflight(request, asked)
        response = self.get_response(request)
        if request.method in READS and not _is_page(response):
            response["Access-Control-Allow-Origin"] = "*"
            response["Access-Control-Expose-Headers"] = ", ".join(_SEEN_HEADERS)
        return response


class Fresh(ConditionalGetMiddleware):
    """Middleware: an ETag and a Cache-Control for every answer that is not a page and has none, and 304 where the
    reader has it already. What was said to no one else is kept by no one else."""

    def process_response(self, request: HttpRequest, response: HttpResponseBase) -> HttpResponseBase:
        for name, value in getattr(request, "rate_limit", {}).items():
            response[name] = value
        if request.method not in READS or response.status_code != 200 or _is_page(response) or _lives(request):
            return response
        if not response.has_header("Cache-Control"):
            response["Cache-Control"] = OWN if _is_somebody(request) else OPEN
            patch_vary_headers(response, ("Authorization", "Cookie"))
        if isinstance(response, FileResponse) and not response.has_header("ETag"):
            etag = _etag_of_file(response)
            if etag:
                response["ETag"] = etag
        return super().process_response(request, response)


class Compressed(GZipMiddleware):
    """Middleware: gzip for text that holds no secret of a browser's."""

    def process_response(self, request: HttpRequest, response: HttpResponseBase) -> HttpResponseBase:
        kind = response.get("Content-Type", "").partition(";")[0].strip().lower()
        secret = settings.SESSION_COOKIE_NAME in request.COOKIES or response.cookies
        if kind not in COMPRESSED or secret or response.status_code != 200:
            return response
        return super().process_response(request, response)


def _preflight(request: HttpRequest, asked: str) -> HttpResponse:
    """What a browser wants to know before it lets a script of another site read; of writing nothing is said."""
    response = HttpResponse(status=204)
    response["Access-Control-Max-Age"] = str(_PREFLIGHT_S)
    patch_vary_headers(response, ("Origin", "Access-Control-Request-Method"))
    if asked in READS:
        response["Access-Control-Allow-Origin"] = "*"
        response["Access-Control-Allow-Methods"] = ", ".join(READS)
        response["Access-Control-Allow-Headers"] = ", ".join(_ALLOWED_HEADERS)
    return response


def _is_page(response: HttpResponseBase) -> bool:
    return response.get("Content-Type", "text/html").startswith(("text/html", "text/event-stream"))


def _lives(request: HttpRequest) -> bool:
    """Whether it tells how the site is right now."""
    return request.path.startswith("/health/")


def _is_somebody(request: HttpRequest) -> bool:
    known = "Authorization" in request.headers or settings.SESSION_COOKIE_NAME in request.COOKIES
    return known or is_spectator(request)


def _etag_of_file(response: FileResponse) -> str:
    """Stored files never change under their name."""
    name, length = getattr(response.file_to_stream, "name", None), response.get("Content-Length", "")
    return quote_etag(hashlib.sha256(f"{name} {length}".encode()).hexdigest()[:32]) if name and length else ""
