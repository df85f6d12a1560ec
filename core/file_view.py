"""Operations that answer with a file: what a program may ask for, and that everything else they say is JSON."""

from __future__ import annotations

from rest_framework.renderers import BaseRenderer, JSONRenderer
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

READS = ("GET", "HEAD")


class FileRenderer(BaseRenderer):
    """Lets a program ask for a kind of file by ``Accept``; the view itself writes it, so nothing is ever rendered."""

    charset = None

    def __init__(self, media_type: str) -> None:
        self.media_type = media_type
        self.format = media_type.rpartition("/")[2]


class FileView(APIView):
    """A view whose GET answers with a file of :attr:`media_type`.

    ``Accept`` may name that type, or JSON, in which failures are told. Any other method answers in JSON whatever a
    program would take, and so does a failure: a program that asked for a video can read why there is none.
    """

    media_type = "application/zip"

    def get_renderers(self) -> list[BaseRenderer]:
        return [JSONRenderer(), FileRenderer(self.media_type)]

    def perform_content_negotiation(self, request: Request, force: bool = False) -> tuple[BaseRenderer, str]:
        if request.method not in READS:
            return JSONRenderer(), JSONRenderer.media_type
        return super().perform_content_negotiation(request, force)

    def handle_exception(self, exc: Exception) -> Response:
        self.request.accepted_renderer, self.request.accepted_media_type = JSONRenderer(), JSONRenderer.media_type
        return super().handle_exception(exc)
