"""A bound on what a request may carry, checked before anything reads it."""

from __future__ import annotations

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse

from paddock.errors import UserFault

from .errors import handle

# Form fields and boundaries beside the file itself.
OVERHEAD_BYTES = 1024 * 1024


class BodyLimit:
    """Middleware: refuses API requests that announce more than PADDOCK_UPLOAD_LIMIT_MB. What comes in chunks has been
    taken whole by the web server, and measured (config.whole).

    Django bounds form fields and JSON (DATA_UPLOAD_MAX_MEMORY_SIZE), but not files, and it spools them to disk as soon
    as anything asks for the form: with session authentication even the check of the CSRF token does.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if request.path.startswith("/api/"):
            limit_mb = settings.UPLOAD_LIMIT_MB
            if _announced(request) > limit_mb * 1024 * 1024 + OVERHEAD_BYTES:
                return _refused(UserFault("too_large", limit_mb=limit_mb))
        return self.get_response(request)


def _refused(error: Exception) -> JsonResponse:
    refusal = handle(error, {})
    return JsonResponse(refusal.data, status=refusal.status_code)


def _announced(request: HttpRequest) -> int:
    """Bytes in the body as announced; 0 where there is no announcement (then Django reads nothing)."""
    try:
        return int(request.META.get("CONTENT_LENGTH") or 0)
    except ValueError:
        return 0
