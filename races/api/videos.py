"""Videos of a finished evaluation: ask for one, see how far it is, download it."""

from __future__ import annotations

from typing import Any

from django.conf import settings
from django.http.response import HttpResponseBase
from django.urls import reverse
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema, extend_schema_field
from rest_framework import serializers, status
from rest_framework.exceptions import PermissionDenied
from rest_framework.permissions import AllowAny, IsAuthenticated, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from core.file_view import FileView
from evaluation.models import State
from videos.models import REEL, WHOLE
from videos.responses import page_language, ready_video, video_response, visible_video
from videos.run import VideoRun
from videos.selectors import ShownVideo, can_stop_video, shown_video, videos_of
from videos.services import ask_for_video, stop_video

from .evaluations import ReasonSerializer, reason_of
from .lookup import visible_evaluation

STATES = [
    ("waiting", "in the queue"),
    ("drawing", "rendering"),
    ("ready", "can be watched"),
    ("stale", "shows a name or a look of before: ask for it again"),
    ("failed", "see the reason"),
]


class VideoSerializer(serializers.Serializer):
    """A video of a run."""

    public_id = serializers.CharField(source="video.public_id")
    evaluation = serializers.CharField(source="video.evaluation.public_id")
    car = serializers.IntegerField(source="video.car", help_text="The car that is followed; 0 is the evaluation's own.")
    lap = serializers.SerializerMethodField(
        help_text="The lap that it shows; null for the whole run, and for highlights."
    )
    language = serializers.CharField(source="video.language", help_text="Of the words in the picture.")
    state = serializers.ChoiceField(STATES)
    position = serializers.IntegerField(allow_null=True, help_text="In the queue, 1 is the next; null unless waiting.")
    progress = serializers.IntegerField(source="video.progress", help_text="Per cent.")
    reason = serializers.SerializerMethodField(help_text="When it failed.")
    asked_at = serializers.DateTimeField(source="video.asked_at")
    ended_at = serializers.DateTimeField(source="video.ended_at", allow_null=True)
    file = serializers.SerializerMethodField(help_text="Where it is downloaded, once it is ready.")
    size = serializers.SerializerMethodField(help_text="Bytes.")
    duration_ms = serializers.SerializerMethodField(help_text="How long it plays.")
    sha256 = serializers.SerializerMethodField(help_text="Of the file.")

    def get_lap(self, shown: ShownVideo) -> int | None:
        return shown.video.part if shown.video.part not in (WHOLE, REEL) else None

    @extend_schema_field(ReasonSerializer(allow_null=True))
    def get_reason(self, shown: ShownVideo) -> dict[str, Any] | None:
        return reason_of(shown.video.reason_code, shown.video.reason, shown.video.reason_params)

    def get_file(self, shown: ShownVideo) -> str | None:
        return self._if_ready(shown, reverse("api-video-file", args=[shown.video.public_id]))

    def get_size(self, shown: ShownVideo) -> int | None:
        return self._if_ready(shown, shown.video.size)

    def get_duration_ms(self, shown: ShownVideo) -> int | None:
        return self._if_ready(shown, shown.video.duration_ms)

    def get_sha256(self, shown: ShownVideo) -> str | None:
        return self._if_ready(shown, shown.video.sha256)

    def _if_ready(self, shown: ShownVideo, value: Any) -> Any:
        return value if shown.state == "ready" else None


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
    language = serializers.ChoiceField(
        settings.LANGUAGES, required=False, help_text="Of the words in the picture; that of the request if not given."
    )


class VideosView(APIView):
    """The videos of an evaluation."""

    token_scope = RACE
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="list_videos",
        summary="The videos of an evaluation, the one asked for last first",
        description="None for an evaluation that is not finished.",
        responses=VideosSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        shown = videos_of(VideoRun.of(evaluation)) if evaluation.state == State.FINISHED else []
        return Response(VideosSerializer({"results": shown}).data)

    @extend_schema(
        operation_id="ask_for_video",
        summary="Ask for a video of a finished evaluation",
        description=(
            "It is drawn on the server: read it until its state is `ready`. Asking for the same again answers the same "
            "video (200) and counts nothing; one that failed or is stale is made again."
        ),
        request=AskSerializer,
        responses={200: VideoSerializer, 202: VideoSerializer},
        tags=["evaluations"],
    )
    def post(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        wanted = {"language": page_language()} | read_as(AskSerializer, request.data)
        asked = ask_for_video(evaluation=evaluation, by=racer_of(request), now=timezone.now(), **wanted)
        asked.video.evaluation = evaluation
        answer = VideoSerializer(shown_video(asked.video)).data
        return Response(answer, status=status.HTTP_202_ACCEPTED if asked.queued else status.HTTP_200_OK)


class VideoView(APIView):
    """One video."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_video",
        summary="A video: state, place in the queue, progress, reason, file",
        responses=VideoSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        return Response(VideoSerializer(shown_video(visible_video(request.user, public_id))).data)


class VideoStopView(APIView):
    """Stopping a video."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="stop_video",
        summary="Stop a video that you asked for while it waits or is being drawn",
        description="One that is done already is left as it is.",
        request=None,
        responses=VideoSerializer,
        tags=["evaluations"],
    )
    def post(self, request: Request, public_id: str) -> Response:
        video = visible_video(request.user, public_id)
        refuse_fields(request)
        if video.is_under_way:
            if not can_stop_video(request.user, video):
                raise PermissionDenied()
            stop_video(video=video, now=timezone.now())
            video = visible_video(request.user, public_id)
        return Response(VideoSerializer(shown_video(video)).data)


class VideoFileView(FileView):
    """The file."""

    permission_classes = [AllowAny]
    media_type = "video/mp4"

    @extend_schema(
        operation_id="read_video_file",
        summary="The file of a video that is ready",
        description="`Range` gives a part of it (206), `If-None-Match` saves fetching it again (304).",
        parameters=[OpenApiParameter("Range", str, OpenApiParameter.HEADER, description="Such as bytes=0-65535.")],
        responses={
            (200, "video/mp4"): OpenApiResponse(OpenApiTypes.BINARY, description="MP4 (H.264, no sound)."),
            (206, "video/mp4"): OpenApiResponse(OpenApiTypes.BINARY, description="The part that was asked for."),
            304: OpenApiResponse(description="It is as it was."),
            416: OpenApiResponse(description="The file has no such part; Content-Range says how long it is."),
        },
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return video_response(request._request, ready_video(request.user, public_id), download=True)
