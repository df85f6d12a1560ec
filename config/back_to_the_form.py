"""Whoever sends a form without being logged in any more comes back to the page that the form is on."""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

from django.conf import settings
from django.contrib.auth import REDIRECT_FIELD_NAME
from django.contrib.auth.views import redirect_to_login
from django.http import HttpRequest, HttpResponse
from django.shortcuts import resolve_url
from django.utils.http import url_has_allowed_host_and_scheme

_READS = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})


class BackToTheForm:
    """Middleware: a log-in that a sent form led to ends on the form's page, or at home where the browser names none.

    The address that it was sent to answers no GET, so that the log-in would end on an error.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        response = self.get_response(request)
        if request.method not in _READS and response.status_code == 302 and _leads_to_log_in(response["Location"]):
            response["Location"] = redirect_to_login(_page_of_form(request))["Location"]
        return response


def _leads_to_log_in(location: str) -> bool:
    parts = urlsplit(location)
    return parts.path == resolve_url(settings.LOGIN_URL) and REDIRECT_FIELD_NAME in parse_qs(parts.query)


def _page_of_form(request: HttpRequest) -> str:
    page = request.META.get("HTTP_REFERER", "")
    if not url_has_allowed_host_and_scheme(page, {request.get_host()}, require_https=request.is_secure()):
        return resolve_url(settings.LOGIN_REDIRECT_URL)
    parts = urlsplit(page)
    return parts._replace(scheme="", netloc="", fragment="").geturl() or "/"
