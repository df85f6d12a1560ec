"""A site of a few views that tell what the web server hands on."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from pathlib import Path

from django.conf import settings
from django.core.wsgi import get_wsgi_application
from django.http import FileResponse, HttpRequest, HttpResponse, StreamingHttpResponse
from django.urls import path

LARGE = 32 * 1024 * 1024


def live(request: HttpRequest) -> HttpResponse:
    return HttpResponse("ok")


def length(request: HttpRequest) -> HttpResponse:
    counted = 0
    while piece := request.read(1 << 20):
        counted += len(piece)
    return HttpResponse(str(counted))


def counted(request: HttpRequest) -> HttpResponse:
    answer = length(request)
    answer["Content-Length"] = str(len(answer.content))
    return answer


def told(request: HttpRequest) -> HttpResponse:
    said = request.META
    forwarded = said["HTTP_X_FORWARDED_FOR"], said["HTTP_X_FORWARDED_PROTO"]
    return HttpResponse(" ".join((*forwarded, request.scheme, said["REMOTE_ADDR"])))


def slow(request: HttpRequest) -> HttpResponse:
    time.sleep(1)
    return HttpResponse("at last")


def file(request: HttpRequest) -> FileResponse:
    return FileResponse(io.BytesIO(bytes(LARGE)))


def made(request: HttpRequest) -> StreamingHttpResponse:
    def pieces() -> Iterator[bytes]:
        for _ in range(LARGE // 65536):
            yield bytes(65536)

    return StreamingHttpResponse(pieces())


urlpatterns = [
    path("health/live", live),
    path("api/length", length),
    path("api/counted", counted),
    path("told", told),
    path("slow", slow),
    path("file", file),
    path("made", made),
]
settings.configure(
    ALLOWED_HOSTS=["127.0.0.1"],
    ROOT_URLCONF=__name__,
    MIDDLEWARE=[],
    SECRET_KEY="nothing is signed",
    UPLOAD_LIMIT_MB=128,
    STREAM_SOCKET=Path("/nowhere/streams.sock"),  # nothing is streamed
)
application = get_wsgi_application()
