"""Refuses requests whose body is too large before anything reads them."""

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils.deprecation import MiddlewareMixin

from core.api.errors import handle
from paddock.errors import UserFault

MEGABYTE = 1024 * 1024
# A track file is at most 2 MB; a model's page has the limit of uploads, for accounts that may upload.
FORM_MB = 4
OVERHEAD_BYTES = MEGABYTE  # form fields and boundaries beside the file itself


def takes_models(path: str) -> bool:
    return is_api(path) or path == "/models/upload/"


def is_api(path: str) -> bool:
    """Whether the API answers at ``path``. It authenticates a model's sender before it reads the body."""
    return path.startswith("/api/")


class BodyLimit(MiddlewareMixin):
    """Middleware: refuses requests that announce too large a body. The web server measures chunked ones
    (config.serving.request_limits).

    Django bounds form fields and JSON (DATA_UPLOAD_MAX_MEMORY_SIZE) but spools files of any size to disk as soon as
    anything reads the form: the check of the CSRF token does, for every POST.
    """

    def process_request(self, request: HttpRequest) -> HttpResponse | None:
        to_api = is_api(request.path)
        may_be_large = takes_models(request.path) and (to_api or request.user.is_authenticated)
        limit_mb = settings.UPLOAD_LIMIT_MB if may_be_large else FORM_MB
        if _announced(request) <= limit_mb * MEGABYTE + OVERHEAD_BYTES:
            return None
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
