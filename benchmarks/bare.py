"""A Django site with one view that answers at once, for config.web: what a request costs before all else."""

from __future__ import annotations

from pathlib import Path

from django.conf import settings
from django.core.wsgi import get_wsgi_application
from django.http import HttpRequest, HttpResponse
from django.urls import path


def hello(request: HttpRequest) -> HttpResponse:
    """A line of text."""
    return HttpResponse("hello", content_type="text/plain", headers={"Content-Length": "5"})


urlpatterns = [path("", hello)]
settings.configure(
    ALLOWED_HOSTS=["127.0.0.1"],
    ROOT_URLCONF=__name__,
    MIDDLEWARE=[],
    SECRET_KEY="nothing is signed",
    UPLOAD_LIMIT_MB=1,
    STREAM_SOCKET=Path("/nowhere/streams.sock"),  # nothing is streamed
)
application = get_wsgi_application()
