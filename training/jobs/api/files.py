"""Downloads of a training: models, logs, the newest sim-trace."""

from django.http import HttpResponseBase
from django.utils.translation import gettext as _
from drf_spectacular.types import OpenApiTypes
from rest_framework import serializers
from rest_framework.exceptions import NotFound
from rest_framework.renderers import BaseRenderer
from rest_framework.request import Request

from accounts.request_racer import racer_of
from core.api.operations import ZIP, csv_of, operation
from core.api.views import FileRenderer, FileView, PrivateView
from core.forms import explain
from paddock.errors import UserFault
from training.jobs.exports import SB3_TYPE, Download, download

from .trainings import visible_training


class PackageQuery(serializers.Serializer):
    """Which model."""

    model = serializers.ChoiceField(["best", "last"], default="best")


class TrainingFileView(PrivateView, FileView):
    def send(self, public_id: str, file: Download, missing: str = "") -> HttpResponseBase:
        """The file. Raises Http404, and NotFound with the sentence ``missing``."""
        response = download(visible_training(self.request, public_id), file, racer_of(self.request))
        if response is None:
            raise NotFound(missing)
        return response


class TrainingPackageView(TrainingFileView):
    @operation(
        "training_package",
        "The best or the last model of a training as a package",
        query=PackageQuery,
        answer=ZIP,
        description="A zip of the ONNX and its model_metadata.json.",
    )
    def get(self, request: Request, public_id: str, asked: dict[str, Download]) -> HttpResponseBase:
        return self.send(public_id, asked["model"], explain(UserFault("training_no_model")))


class TrainingSb3View(TrainingFileView):
    media_type = SB3_TYPE

    def get_renderers(self) -> list[BaseRenderer]:
        return [*super().get_renderers(), FileRenderer("application/zip")]  # what it was called before

    @operation(
        "training_sb3",
        "The model as stable-baselines3 saves it",
        description="A zip with pickles in it, which a racer's own Python has written: stable-baselines3 runs what "
        "they say when it loads them. Load your own only, or in a sandbox. For admins, who may read everybody's, its "
        "name begins with UNTRUSTED.",
        answer={(200, SB3_TYPE): OpenApiTypes.BINARY},
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "sb3", _("This training has no file of stable-baselines3."))


class TrainingLogsView(TrainingFileView):
    @operation(
        "training_logs", "Log, reward function, settings, metrics and sim-traces of a training in one zip", answer=ZIP
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "logs")


class TrainingTraceView(TrainingFileView):
    media_type = "text/csv"

    @operation("training_trace", "The newest sim-trace CSV of a training", answer=csv_of("A line a control step."))
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return self.send(public_id, "trace", _("This training has no sim-trace yet."))
