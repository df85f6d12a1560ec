"""The site's address in links: the one from the settings, not from the request."""

from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.http.request import split_domain_port, validate_host
from django.utils.encoding import iri_to_uri

Answer = Callable[[HttpRequest], HttpResponse]


class ConfiguredLinks:
    """Middleware: absolute links begin with the request's host only if the settings name that host and port, else with
    PADDOCK_SITE_URL: Django accepts any port with an allowed host."""

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
    """Scheme, host and port of an answer's links."""
    host = request.get_host()
    came_in = f"{request.scheme}://{host}"
    if came_in in settings.CSRF_TRUSTED_ORIGINS:  # PADDOCK_SITE_URL is the first of them
        return came_in
    name, port = split_domain_port(host)
    ours = urlsplit(settings.SITE_URL)
    named = [allowed for allowed in settings.ALLOWED_HOSTS if allowed and allowed != "*"]
    same_port = port == str(ours.port or "") and request.scheme == ours.scheme
    return came_in if name and validate_host(name, named) and (not port or same_port) else settings.SITE_URL
