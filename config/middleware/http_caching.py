"""Adds ETag, Cache-Control, gzip and CORS to answers for programs.

Pages are left alone: each contains a CSRF token, so it never repeats, and compressing it would leak the token (BREACH).
For the same reason no answer to a request with a session cookie is compressed.
"""

import hashlib
import re

from corsheaders.middleware import CorsMiddleware
from django.conf import settings
from django.http import FileResponse, HttpRequest, HttpResponseBase
from django.middleware.gzip import GZipMiddleware
from django.middleware.http import ConditionalGetMiddleware
from django.utils.cache import patch_vary_headers
from django.utils.http import quote_etag

from races.web.spectator_links import is_spectator

READS = ("GET", "HEAD")
COMPRESSED = (
    *("application/json", "application/vnd.oai.openapi", "application/vnd.oai.openapi+json", "application/yaml"),
    *("application/atom+xml", "text/csv", "text/calendar", "text/plain", "image/svg+xml"),
)
# Both are asked for again, and answered 304 while they are the same.
OPEN, OWN = "public, no-cache", "private, no-cache"
_GZIP_TAG = re.compile(r'(?<!W/)("[^"]*)-gzip"')


class ConditionalGet(ConditionalGetMiddleware):
    """Middleware: an ETag and a Cache-Control for every answer that is not a page and has none, and 304 for unchanged
    ones. Shared caches keep no answer for one reader."""

    def process_response(self, request: HttpRequest, response: HttpResponseBase) -> HttpResponseBase:
        for name, value in getattr(request, "rate_limit", {}).items():
            response[name] = value
        if request.method not in (*READS, "OPTIONS") and not is_page(response):
            response.setdefault("Cache-Control", "no-store")  # many answers to writes contain a secret
        if request.method not in READS or response.status_code != 200 or is_page(response) or _lives(request):
            return response
        if not response.has_header("Cache-Control"):
            response["Cache-Control"] = OWN if _is_somebody(request) else OPEN
            patch_vary_headers(response, ("Authorization", "Cookie"))
        if isinstance(response, FileResponse) and not response.has_header("ETag"):
            etag = _etag_of_file(response)
            if etag:
                response["ETag"] = etag
        return super().process_response(request, response)


class Compression(GZipMiddleware):
    """Middleware: gzip for text that holds no browser's secret. The compressed form has its own strong ETag,
    ``"…-gzip"``, so that ``If-Match`` takes it."""

    max_random_bytes = 0  # a strong ETag requires identical bytes

    def process_request(self, request: HttpRequest) -> None:
        for name in ("HTTP_IF_MATCH", "HTTP_IF_NONE_MATCH"):
            sent = request.META.get(name, "")
            if zipped := _GZIP_TAG.findall(sent):
                request.META[name] = ", ".join((sent, *(f'{tag}"' for tag in zipped)))

    def process_response(self, request: HttpRequest, response: HttpResponseBase) -> HttpResponseBase:
        tag = response.get("ETag", "")
        zipped = f'{tag[:-1]}-gzip"'
        if response.status_code == 304 and zipped in request.headers.get("If-None-Match", ""):
            response["ETag"] = zipped
        kind = response.get("Content-Type", "").partition(";")[0].strip().lower()
        secret = settings.SESSION_COOKIE_NAME in request.COOKIES or response.cookies
        if kind not in COMPRESSED or secret or response.status_code != 200:
            return response
        response = super().process_response(request, response)
        if response.get("ETag", "") == f"W/{tag}":
            response["ETag"] = zipped
        return response


class PublicReads(CorsMiddleware):
    """Middleware (CORS): any script may read the API and the files beside pages, but no page, and may not write.

    Browsers send no cookies along (``*`` forbids it), so a script needs a token. Off with PADDOCK_CORS=False.
    """

    def is_enabled(self, request: HttpRequest) -> bool:
        preflight = request.headers.get("Access-Control-Request-Method", "")
        return settings.CORS and (preflight if request.method == "OPTIONS" else request.method) in READS

    def add_response_headers(self, request: HttpRequest, response: HttpResponseBase) -> HttpResponseBase:
        if "Origin" not in request.headers or (request.method != "OPTIONS" and is_page(response)):
            return response
        return super().add_response_headers(request, response)


def is_page(response: HttpResponseBase) -> bool:
    return response.get("Content-Type", "text/html").startswith(("text/html", "text/event-stream"))


def _lives(request: HttpRequest) -> bool:
    return request.path.startswith("/health/")


def _is_somebody(request: HttpRequest) -> bool:
    known = "Authorization" in request.headers or settings.SESSION_COOKIE_NAME in request.COOKIES
    return known or is_spectator(request)


def _etag_of_file(response: FileResponse) -> str:
    """Stored files never change under their name."""
    name, length = getattr(response.file_to_stream, "name", None), response.get("Content-Length", "")
    return quote_etag(hashlib.sha256(f"{name} {length}".encode()).hexdigest()[:32]) if name and length else ""
