"""A bound on what a form may carry, checked before anything reads it."""

from __future__ import annotations

from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render

MEGABYTE = 1024 * 1024
# A track file is at most 2 MB; a model's page has the limit of uploads, for who may upload.
FORM_MB = 4
OVERHEAD_BYTES = MEGABYTE  # form fields and boundaries beside the file itself


class PageBodyLimit:
    """Middleware: refuses page requests that announce too large a body, with a page that says so.

    Django bounds form fields (DATA_UPLOAD_MAX_MEMORY_SIZE) but not files, and spools those to disk as soon as anything
    asks for the form: the check of the CSRF token does, for every POST by anybody. The API has its own limit.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not request.path.startswith("/api/"):
            takes_models = request.path == "/models/upload/" and request.user.is_authenticated
            limit_mb = settings.UPLOAD_LIMIT_MB if takes_models else FORM_MB
            if _announced(request) > limit_mb * MEGABYTE + OVERHEAD_BYTES:
                return render(request, "413.html", {"limit_mb": limit_mb}, status=413)
        return self.get_response(request)


def _announced(request: HttpRequest) -> int:
    """Bytes in the body as announced; 0 where there is no announcement (then Django reads nothing)."""
    try:
        return int(request.META.get("CONTENT_LENGTH") or 0)
    except ValueError:
        return 0
