"""Downloads of a training: models, logs, the newest sim-trace."""

from django.http import HttpResponseBase
from django.utils.translation import gettext as _
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema
from rest_framework import serializers
from rest_framework.exceptions import NotFound
from rest_framework.permissions import IsAuthenticated
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request

from accounts.request_racer import racer_of
from core.api.views import FileRenderer, FileView
from core.forms import explain
from paddock.errors import UserFault
from training.jobs.exports import SB3_TYPE, Download, download

from .trainings import visible_training

WHICH = ("best", "last")
ZIP = {(200, "application/zip"): OpenApiTypes.BINARY}


class TrainingFileView(FileView):
    permission_classes = [IsAuthenticated]

    def send(self, public_id: str, file: Download, missing: str = "") -> HttpResponseBase:
        """The file. Raises Http404, and NotFound with the sentence ``missing``."""
        response = download(visible_training(self.request, public_id), file, racer_of(self.request))
        if response is None:
            raise NotFound(missing)
        return response


class TrainingPackageView(TrainingFileView):
    @extend_schema(
        operation_id="training_package",
        summary="The best or the last model of a training as a package",
        description="A zip of the ONNX and its model_metadata.json.",
        parameters=[OpenApiParameter("model", enum=WHICH, default="best")],
        responses=ZIP,
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        which = serializers.ChoiceField(WHICH).run_validation(request.query_params.get("model", "best"))
        return self.send(public_id, which, explain(UserFault("training_no_model")))


class TrainingSb3View(TrainingFileView):
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
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "sb3", _("This training has no file of stable-baselines3."))


class TrainingLogsView(TrainingFileView):
    @extend_schema(
        operation_id="training_logs",
        summary="Log, reward function, settings, metrics and sim-traces of a training in one zip",
        responses=ZIP,
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "logs")


class TrainingTraceView(TrainingFileView):
    media_type = "text/csv"

    @extend_schema(
        operation_id="training_trace",
        summary="The newest sim-trace CSV of a training",
        responses={(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description="A line a control step.")},
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "trace", _("This training has no sim-trace yet."))
