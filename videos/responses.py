"""Responses with the bytes of a video, for pages and the API."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponseBase
from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.translation import get_language

from core.files.range_responses import stored_file_response
from core.files.storage_faults import storage_at_work
from evaluation.garage.downloads import as_download

from .hooks import runs
from .models import CONTENT_TYPES, REEL, WHOLE, Video, VideoFormat, VideoState
from .selectors import shown_video, videos_visible_to
from .services import forget_lost_file, note_watched

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

PIECE = 1 << 20  # some seconds of a video
_RUN = ("evaluation__result", "evaluation__owner", "evaluation__model__owner", "evaluation__track")


def visible_video(racer: Racer | AnonymousUser, public_id: str) -> Video:
    """The video with its run. Raises Http404 when there is none, or the racer may not see it."""
    videos = videos_visible_to(racer).select_related(*_RUN, *runs().related, "asked_by")
    return get_object_or_404(videos, public_id=public_id)


def ready_video(racer: Racer | AnonymousUser, public_id: str) -> Video:
    """The video if it is ready. Raises Http404 also for an unfinished or stale video."""
    video = visible_video(racer, public_id)
    if shown_video(video).state != VideoState.READY:
        raise Http404
    return video


def video_response(
    request: HttpRequest, video: Video, *, still: bool = False, download: bool = False
) -> HttpResponseBase:
    """The file of a ready video, whole or the part that ``Range`` names, or its still. ``download``: as an attachment;
    a player gets it in pieces. Browsers revalidate their copy.

    Raises Http404 where the file is lost (the video can then be requested again) and PlatformFault("storage_failed").
    """
    now = timezone.now()
    file, kind = (video.poster, "image/jpeg") if still else (video.file, CONTENT_TYPES[VideoFormat(video.format)])
    most = None if download else PIECE
    with storage_at_work():
        try:
            size = file.size if still else video.size
            response = stored_file_response(request, file, size=size, digest=video.sha256, content_type=kind, most=most)
        except FileNotFoundError:
            forget_lost_file(video=video, now=now)
            raise Http404 from None
    if not still and request.method == "GET":
        note_watched(video=video, now=now)
    if download:
        response = as_download(response, file_name(video))
    response["Cache-Control"] = "private, max-age=0, must-revalidate"
    return response


def file_name(video: Video) -> str:
    """The name of the downloaded file: the run, another car's number, the part."""
    part = {WHOLE: "run", REEL: "highlights"}.get(video.part, f"lap{video.part}")
    car = f"-car{video.car}" if video.car else ""
    if video.to_ms:
        part = f"clip-{video.from_ms}-{video.to_ms}"
    return f"{video.evaluation.public_id}{car}-{part}.{video.format}"


def page_language() -> str:
    language = (get_language() or settings.LANGUAGE_CODE).split("-")[0]
    return language if language in dict(settings.LANGUAGES) else settings.LANGUAGE_CODE
