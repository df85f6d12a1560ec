"""What a training is downloaded as: its models, its logs, its newest sim-trace."""

from __future__ import annotations

from django.http import HttpResponse, HttpResponseBase, StreamingHttpResponse
from django.utils.translation import gettext as _
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework import serializers
from rest_framework.exceptions import NotFound
from rest_framework.permissions import IsAuthenticated
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request

from accounts.who import racer_of
from core.file_view import FileRenderer, FileView
from core.forms import explain
from evaluation.files import as_download, download_of
from paddock.errors import UserFault
from training.files import SB3_TYPE, logs_zip, newest_simtrace, sb3_name, sb3_of

from .trainings import visible_training

WHICH = ("best", "last")
ZIP = {(200, "application/zip"): OpenApiTypes.BINARY}


class TrainingPackageView(FileView):
    """The best or the last model."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="training_package",
        summary="The best or the last model of a training as a package",
        description="A zip of the ONNX and its model_metadata.json.",
        parameters=[OpenApiParameter("model", enum=WHICH, default="best")],
        responses=ZIP,
        tags=["trainings"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        job = visible_training(request, public_id)
        which = serializers.ChoiceField(WHICH).run_validation(request.query_params.get("model", "best"))
        model = job.best_model if which == "best" else job.last_model
        if model is None or model.deleted_at is not None:
            raise NotFound(explain(UserFault("training_no_model")))
        return download_of(model)


class TrainingSb3View(FileView):
    """The model for Python."""

    permission_classes = [IsAuthenticated]
    media_type = SB3_TYPE

    def get_renderers(self) -> list[BaseRenderer]:
        return [*super().get_renderers(), FileRenderer("application/zip")]  # what it was called before

    @extend_schema(
        operation_id="training_sb3",
        summary="The model as stable-baselines3 saves it",
        description="A zip with pickles in it, which a racer's own Python has written: stable-baselines3 runs what "
        "they say when it loads them. Load your own only, or in a sandbox. For admins, who may read everybody's, its "
        "name begins with UNTRUSTED.",
        responses={(200, SB3_TYPE): OpenApiTypes.BINARY},
        tags=["trainings"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        job = visible_training(request, public_id)
        data = sb3_of(job)
        if data is None:
            raise NotFound(_("This training has no file of stable-baselines3."))
        return as_download(HttpResponse(data, content_type=SB3_TYPE), sb3_name(job, racer_of(request)))


class TrainingLogsView(FileView):
    """All that was written down."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="training_logs",
        summary="Log, reward function, settings, metrics and sim-traces of a training in one zip",
        responses=ZIP,
        tags=["trainings"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        job = visible_training(request, public_id)
        response = StreamingHttpResponse(logs_zip(job), content_type="application/zip")
        return as_download(response, f"{job.name}-logs.zip")


class TrainingTraceView(FileView):
    """How it drove last."""

    permission_classes = [IsAuthenticated]
    media_type = "text/csv"

    @extend_schema(
        operation_id="training_trace",
        summary="The newest sim-trace CSV of a training",
        responses={(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description="A line a control step.")},
        tags=["trainings"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        job = visible_training(request, public_id)
        newest = newest_simtrace(job)
        if newest is None:
            raise NotFound(_("This training has no sim-trace yet."))
        number, data = newest
        response = HttpResponse(data, content_type="text/csv; charset=utf-8")
        return as_download(response, f"{job.name}-{number}-sim-trace.csv")
