"""Where the site is: links lead to addresses that the operator has set, whatever a request says it was sent to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.http.request import split_domain_port, validate_host
from django.utils.encoding import iri_to_uri

Answer = Callable[[HttpRequest], HttpResponse]


class ConfiguredLinks:
    """Middleware: ``request.build_absolute_uri``, of which links in mails, feeds and pages are made, begins with where
    the request came in only if the operator has named that; else with PADDOCK_SITE_URL.

    Django takes any port with a host that is allowed, so ``Host: localhost:666`` would stand in a mail.
    """

    def __init__(self, get_response: Answer) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        made = request.build_absolute_uri

        def build_absolute_uri(location: Any = None) -> str:
            parts = urlsplit(made(location))
            came_in = f"{request.scheme}://{request.get_host()}"
            if f"{parts.scheme}://{parts.netloc}" != came_in:
                return parts.geturl()  # it leads elsewhere by itself
            return iri_to_uri(origin_of(request) + parts._replace(scheme="", netloc="").geturl())

        request.build_absolute_uri = build_absolute_uri  # type: ignore[method-assign]
        return self.get_response(request)


def origin_of(request: HttpRequest) -> str:
    """Scheme, host and port that links of an answer begin with."""
    host = request.get_host()
    came_in = f"{request.scheme}://{host}"
    if came_in in settings.CSRF_TRUSTED_ORIGINS:  # PADDOCK_SITE_URL is the first of them
        return came_in
    name, port = split_domain_port(host)
    ours = urlsplit(settings.SITE_URL)
    named = [allowed for allowed in settings.ALLOWED_HOSTS if allowed and allowed != "*"]
    same_port = port == str(ours.port or "") and request.scheme == ours.scheme
    return came_in if name and validate_host(name, named) and (not port or same_port) else settings.SITE_URL
