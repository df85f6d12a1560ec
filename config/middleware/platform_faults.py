"""Answers a platform fault in a view with a 503 page that names its reason."""

import logging

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.deprecation import MiddlewareMixin
from django.views.defaults import page_not_found

from core.files.storage_faults import is_of_storage
from core.jobs.models import reason_sentence
from core.validators import is_of_nul
from paddock.errors import PlatformFault

logger = logging.getLogger(__name__)
RETRY_AFTER_S = 30


class PlatformFaults(MiddlewareMixin):
    """Middleware: a page that raises a PlatformFault, or whose stored files cannot be read, is a 503 with the reason.
    A name with a NUL is a 404. The API has its own answers (``core.api.errors``)."""

    def process_exception(self, request: HttpRequest, error: Exception) -> HttpResponse | None:
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
        response._has_been_logged = True  # type: ignore[attr-defined]  # Django writes no second line
        return response
