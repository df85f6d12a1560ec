"""Counts requests, where metrics are on."""

from collections.abc import Callable
from time import perf_counter

from django.conf import settings
from django.http import HttpRequest, HttpResponse

from core.metrics import Histogram

SCRAPE = "metrics"  # the view that is not counted
REQUESTS = Histogram(
    "paddock_request_seconds",
    "Time of a request in a web process, by the name of its view and the class of its status.",
    ("view", "status"),
    buckets=(0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10),
)


class RequestMetrics:
    """Middleware: the time of each request, by view."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        began = perf_counter()
        response = self.get_response(request)
        view = _view_of(request)
        if view != SCRAPE:
            REQUESTS.observe(perf_counter() - began, view, f"{response.status_code // 100}xx")
        return response


def _view_of(request: HttpRequest) -> str:
    """Never the path, of which there are as many as clients make up."""
    if request.resolver_match is not None:
        return request.resolver_match.view_name or "unnamed"
    return "static" if request.path.startswith(settings.STATIC_URL) else "none"
