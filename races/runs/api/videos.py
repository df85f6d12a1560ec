"""Videos of a finished evaluation: ask for one, see how far it is, download it."""

from collections.abc import Callable
from typing import Any, NotRequired, TypedDict

from django.conf import settings
from django.http.response import HttpResponseBase
from django.urls import reverse
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse
from rest_framework import serializers, status
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ComputedField, ReasonField
from core.api.operations import operation
from core.api.views import APIView, FileView
from evaluation.models import Evaluation, State
from videos.models import CLIPS, WHOLE, Video, VideoCamera, VideoFormat
from videos.responses import page_language, ready_video, video_response, visible_video
from videos.scenes import ClipForm, VideoRun
from videos.selectors import ShownVideo, can_stop_video, shown_video, videos_of
from videos.services import request_video, stop_video

from ...web.api import visible_evaluation

LONGEST_MS = 2**31 - 1
STATES = [
    ("waiting", "in the queue"),
    ("drawing", "rendering"),
    ("ready", "can be watched"),
    ("stale", "shows a name or a look of before: ask for it again"),
    ("failed", "see the reason"),
]


def _if_ready(shown_as: serializers.Field, value: Callable[[Video], Any], help_text: str) -> ComputedField:
    """A field of a video that is ready."""
    return ComputedField(
        shown_as, lambda shown: value(shown.video) if shown.state == "ready" else None, help_text=help_text
    )


class VideoSerializer(serializers.Serializer):
    """A video of a run."""

    public_id = serializers.CharField(source="video.public_id")
    evaluation = serializers.CharField(source="video.evaluation.public_id")
    car = serializers.IntegerField(source="video.car", help_text="The car that is followed; 0 is the evaluation's own.")
    lap = ComputedField(
        serializers.IntegerField(allow_null=True),
        lambda shown: shown.video.part if WHOLE < shown.video.part < CLIPS else None,
        help_text="The lap that it shows; null for the whole run, a clip, and highlights.",
    )
    from_ms = serializers.IntegerField(source="video.from_ms", help_text="Where a clip begins in the run.")
    to_ms = serializers.IntegerField(source="video.to_ms", help_text="Where it ends; 0 unless it is a clip.")
    camera = serializers.ChoiceField(VideoCamera.choices, source="video.camera")
    format = serializers.ChoiceField(VideoFormat.choices, source="video.format")
    language = serializers.CharField(source="video.language", help_text="Of the words in the picture.")
    state = serializers.ChoiceField(STATES)
    position = serializers.IntegerField(allow_null=True, help_text="In the queue, 1 is the next; null unless waiting.")
    progress = serializers.IntegerField(source="video.progress", help_text="Per cent.")
    reason = ReasonField(source="video", help_text="When it failed.")
    asked_at = serializers.DateTimeField(source="video.asked_at")
    ended_at = serializers.DateTimeField(source="video.ended_at", allow_null=True)
    file = _if_ready(
        serializers.CharField(allow_null=True),
        lambda video: reverse("api-video-file", args=[video.public_id]),
        "Where it is downloaded, once it is ready.",
    )
    size = _if_ready(serializers.IntegerField(allow_null=True), lambda video: video.size, "Bytes.")
    duration_ms = _if_ready(
        serializers.IntegerField(allow_null=True), lambda video: video.duration_ms, "How long it plays."
    )
    sha256 = _if_ready(serializers.CharField(allow_null=True), lambda video: video.sha256, "Of the file.")


class VideosSerializer(serializers.Serializer):
    """All videos of a run."""

    results = VideoSerializer(many=True)


class AskSerializer(Body):
    """Which video."""

    part = serializers.CharField(
        default="best", max_length=20, help_text="“whole”, “best” (the car's fastest lap) or the number of a lap."
    )
    car = serializers.IntegerField(
        default=0, min_value=0, max_value=99, help_text="The car to follow: 0 is the evaluation's own, rivals from 1."
    )
    from_ms = serializers.IntegerField(
        default=0, min_value=0, max_value=LONGEST_MS, help_text="Where a clip begins, in simulated ms of the run."
    )
    to_ms = serializers.IntegerField(
        default=0, min_value=0, max_value=LONGEST_MS, help_text="Where it ends; 0 shows the whole part."
    )
    camera = serializers.ChoiceField(VideoCamera.choices, default="follow")
    format = serializers.ChoiceField(
        VideoFormat.choices, default="mp4", help_text="`webp` is a small picture that moves, of 20 s at most."
    )
    language = serializers.ChoiceField(
        settings.LANGUAGES, required=False, help_text="Of the words in the picture; that of the request if not given."
    )


class SentVideo(TypedDict):
    """What :class:`AskSerializer` reads."""

    part: str
    car: int
    from_ms: int
    to_ms: int
    camera: str
    format: str
    language: NotRequired[str]


class VideosView(APIView):
    token_scope = RACE

    @operation(
        "list_videos",
        "The videos of an evaluation, the one asked for last first",
        find=visible_evaluation,
        answer=VideosSerializer,
        description="Empty unless the evaluation is finished.",
    )
    def get(self, request: Request, evaluation: Evaluation) -> dict[str, list[ShownVideo]]:
        return {"results": videos_of(VideoRun.of(evaluation)) if evaluation.state == State.FINISHED else []}

    @operation(
        "ask_for_video",
        "Ask for a video of a finished evaluation",
        find=visible_evaluation,
        body=AskSerializer,
        answer={200: VideoSerializer, 202: VideoSerializer},
        description=(
            "It is drawn on the server: read it until its state is `ready`. Asking for the same again answers the same "
            "video (200) and counts nothing; one that failed or is stale is made again."
        ),
    )
    def post(self, request: Request, evaluation: Evaluation, sent: SentVideo) -> Response:
        asked = request_video(
            evaluation=evaluation,
            by=racer_of(request),
            car=sent["car"],
            part=sent["part"],
            language=sent.get("language", page_language()),
            now=timezone.now(),
            form=ClipForm(sent["from_ms"], sent["to_ms"], sent["camera"], sent["format"]),
        )
        asked.video.evaluation = evaluation
        answer = VideoSerializer(shown_video(asked.video)).data
        return Response(answer, status=status.HTTP_202_ACCEPTED if asked.queued else status.HTTP_200_OK)


def seen_video(request: Request, public_id: str) -> Video:
    """A video of a visible run. Raises Http404."""
    return visible_video(request.user, public_id)


class VideoView(APIView):
    @operation(
        "read_video",
        "A video: state, place in the queue, progress, reason, file",
        find=seen_video,
        answer=VideoSerializer,
    )
    def get(self, request: Request, video: Video) -> ShownVideo:
        return shown_video(video)


def stoppable_video(request: Request, public_id: str) -> Video:
    """A video that the caller may stop, or that is done. Raises Http404, PermissionDenied."""
    video = visible_video(request.user, public_id)
    if video.is_under_way and not can_stop_video(request.user, video):
        raise PermissionDenied()
    return video


class VideoStopView(APIView):
    token_scope = RACE

    @operation(
        "stop_video",
        "Stop a video that you asked for while it waits or is being drawn",
        find=stoppable_video,
        answer=VideoSerializer,
        description="A finished video stays unchanged.",
    )
    def post(self, request: Request, video: Video) -> ShownVideo:
        if video.is_under_way:
            stop_video(video=video, now=timezone.now())
            video = visible_video(request.user, video.public_id)
        return shown_video(video)


class VideoFileView(FileView):
    media_type = "video/mp4"

    @operation(
        "read_video_file",
        "The file of a video that is ready",
        description="`Range` gives a part of it (206), `If-None-Match` saves fetching it again (304).",
        parameters=[OpenApiParameter("Range", str, OpenApiParameter.HEADER, description="Such as bytes=0-65535.")],
        answer={
            (200, "video/mp4"): OpenApiResponse(OpenApiTypes.BINARY, description="MP4 (H.264, no sound)."),
            (206, "video/mp4"): OpenApiResponse(OpenApiTypes.BINARY, description="The part that was asked for."),
            304: OpenApiResponse(description="It is as it was."),
            416: OpenApiResponse(description="The file has no such part; Content-Range gives its length."),
        },
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return video_response(request._request, ready_video(request.user, public_id), download=True)
