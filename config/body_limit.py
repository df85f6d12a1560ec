"""A bound on what a request may carry, checked before anything reads it."""

from __future__ import annotations

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render

from core.api.errors import handle
from paddock.errors import UserFault

MEGABYTE = 1024 * 1024
# A track file is at most 2 MB; a model's page has the limit of uploads, for who may upload.
FORM_MB = 4
OVERHEAD_BYTES = MEGABYTE  # form fields and boundaries beside the file itself


def takes_models(path: str) -> bool:
    """Whether a request to ``path`` may carry a model."""
    return is_api(path) or path == "/models/upload/"


def is_api(path: str) -> bool:
    """Whether the API answers at ``path``. It asks who sends a model itself, before it reads it."""
    return path.startswith("/api/")


class BodyLimit:
    """Middleware: refuses requests that announce too large a body, with a page or in the API's form for errors. What
    comes in chunks has been taken whole by the web server, and measured (config.whole).

    Django bounds form fields and JSON (DATA_UPLOAD_MAX_MEMORY_SIZE) but not files, and spools those to disk as soon as
    anything asks for the form: the check of the CSRF token does, for every POST by anybody.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        to_api = is_api(request.path)
        may_be_large = takes_models(request.path) and (to_api or request.user.is_authenticated)
        limit_mb = settings.UPLOAD_LIMIT_MB if may_be_large else FORM_MB
        if _announced(request) <= limit_mb * MEGABYTE + OVERHEAD_BYTES:
            return self.get_response(request)
        if to_api:
            refusal = handle(UserFault("too_large", limit_mb=limit_mb), {})
            return JsonResponse(refusal.data, status=refusal.status_code)
        return render(request, "413.html", {"limit_mb": limit_mb}, status=413)


def _announced(request: HttpRequest) -> int:
    """Bytes in the body as announced; 0 where there is no announcement (then Django reads nothing)."""
    try:
        return int(request.META.get("CONTENT_LENGTH") or 0)
    except ValueError:
        return 0
