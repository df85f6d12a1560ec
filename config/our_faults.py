"""Pages that fail by Paddock's own fault say so, and which one it was."""

from __future__ import annotations

import logging
from collections.abc import Callable

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.defaults import page_not_found

from core.jobs.models import reason_sentence
from core.nul import is_of_nul
from core.storage_faults import is_of_storage
from paddock.errors import PlatformFault

logger = logging.getLogger(__name__)
RETRY_AFTER_S = 30


class OurFaults:
    """Middleware: a page that raises a PlatformFault, or whose stored files cannot be had, is a 503 with the reason.
    One that was asked for a name with a NUL is not there. The API has its own answers (``core.api.errors``)."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        return self.get_response(request)

    def process_exception(self, request: HttpRequest, error: Exception) -> HttpResponse | None:
        """Django calls this with what a view raised."""
        if is_of_nul(error):
            return page_not_found(request, error)
        if is_of_storage(error):
            fault = PlatformFault("storage_failed")
        elif isinstance(error, PlatformFault):
            fault = error
        else:
            return None
        logger.error("%s failed: %s", request.path, fault.code, exc_info=error)
        context = {"code": fault.code, "reason": reason_sentence(fault.code, fault.params)}
        response = render(request, "503.html", context, status=503)
        response["Retry-After"] = str(RETRY_AFTER_S)
        return response
