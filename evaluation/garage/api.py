"""The API of a racer's models. Evaluations are in races.runs.api: their visibility depends on the race."""

from collections.abc import Mapping
from typing import Any, TypedDict

from django.core.files.uploadedfile import UploadedFile
from django.db import transaction
from django.db.models import QuerySet
from django.http import Http404, HttpResponseBase
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter
from rest_framework import serializers, status
from rest_framework.parsers import JSONParser, MultiPartParser
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ChoiceField
from core.api.operations import ZIP, operation
from core.api.views import FileView, PrivateView
from core.validators import visible_line
from paddock.errors import UserFault
from paddock.packages.kinds import EXPORTS, format_texts, is_weights_file
from paddock.packages.read import UploadPart

from ..appearance.looks import Shell, VehicleLook
from ..models import State, TrainedModel
from ..selectors import is_shared, models_of, shared_models, visible_models
from . import services
from .downloads import download_of, export_of, upload_of
from .selectors import LONGEST_SEARCH, GarageSort, algorithm_of, garage_of, with_last_runs


class ModelSummarySerializer(serializers.Serializer):
    """Which model."""

    public_id = serializers.CharField()
    name = serializers.CharField()
    sha256 = serializers.CharField(source="network_id")


class ModelSerializer(serializers.Serializer):
    """A model of the garage, or one that somebody shares."""

    public_id = serializers.CharField()
    owner = serializers.CharField(source="owner.alias", help_text="Whose it is.")
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    sha256 = serializers.CharField(source="network_id", help_text="Of the canonical network: the model's identity.")
    size = serializers.IntegerField(source="network.size", help_text="Bytes of the canonical ONNX.")
    parameters = serializers.IntegerField(source="network.parameters", help_text="Weights of the network.")
    macs = serializers.IntegerField(source="network.macs", help_text="Multiplications a step.")
    sensors = serializers.ListField(child=serializers.CharField())
    metadata = serializers.DictField(help_text="model_metadata.json as it was read, with the field's own keys.")
    shell = serializers.ChoiceField(Shell.choices, help_text="What it looks like in replays.")
    colour = serializers.CharField(help_text="#rrggbb")
    source_kind = ChoiceField(format_texts, help_text="What was uploaded.")
    source_sha256 = serializers.CharField(help_text="Of the upload itself.")
    uploaded_at = serializers.DateTimeField(source="created_at")
    shared = serializers.SerializerMethodField(
        help_text="Every racer may look at it, download it and train on from its weights."
    )

    def get_shared(self, model: TrainedModel) -> bool:
        return is_shared(model)


class LastRunSerializer(serializers.Serializer):
    """What a model did last."""

    evaluation = serializers.CharField(source="public_id")
    state = serializers.ChoiceField(State.choices)
    track = serializers.CharField(source="track.slug")
    best_lap_ms = serializers.IntegerField(source="result.best_lap_ms", default=None, allow_null=True)
    ended_at = serializers.DateTimeField(allow_null=True)


class GarageListSerializer(serializers.ListSerializer):
    """A page of the garage; the last runs of its models are read at once."""

    def to_representation(self, data: Any) -> list[Any]:
        return super().to_representation(with_last_runs(data))


class GarageModelSerializer(ModelSerializer):
    """A model of the garage, with its last run."""

    class Meta:
        list_serializer_class = GarageListSerializer

    algorithm = serializers.SerializerMethodField(help_text="PPO, SAC or another word of its metadata; empty for none.")
    last_run = LastRunSerializer(allow_null=True, help_text="That you asked for; null before the first.")

    def get_algorithm(self, model: TrainedModel) -> str:
        return algorithm_of(model.metadata)


class TakenSerializer(serializers.Serializer):
    """What was taken of an upload."""

    network = serializers.CharField(
        source="taken", allow_blank=True, help_text="The network's name in the archive; empty for a loose file."
    )
    checkpoint = serializers.ChoiceField(
        ["", "best", "last", "asked"],
        source="reason",
        help_text="Of a training's folder: why this one. best: by deepracer_checkpoints.json.",
    )
    output = serializers.CharField(allow_blank=True, help_text="Of a network with several outputs: which one drives.")
    ignored = serializers.ListField(child=serializers.CharField(), help_text="Files that were not needed.")


class UploadedSerializer(ModelSerializer):
    """A model, and what was taken of the upload."""

    upload = TakenSerializer()

    def to_representation(self, uploaded: services.UploadedModel) -> dict:
        model = ModelSerializer(uploaded.model).data
        return {**model, "upload": TakenSerializer(uploaded.package).data}


class GarageFilter(serializers.Serializer):
    """Which models of the garage to list."""

    shared = serializers.BooleanField(
        required=False, allow_null=True, default=None, help_text="Only those that I share, or do not."
    )
    search = serializers.CharField(
        default="",
        allow_blank=True,
        max_length=LONGEST_SEARCH,
        help_text="Part of a name, a description or an algorithm.",
    )
    sort = serializers.ChoiceField(GarageSort.choices, default=GarageSort.NEWEST)


class GarageQuery(TypedDict):
    """What :class:`GarageFilter` reads."""

    shared: bool | None
    search: str
    sort: str


class SharedFilter(serializers.Serializer):
    """Which shared models to list."""

    racer = serializers.CharField(required=False, max_length=64, help_text="Only those of the racer with this alias.")


class UploadSerializer(Body):
    """``package`` (with ``metadata`` if it has none), or ``model`` and ``metadata`` (and ``weights``)."""

    package = serializers.FileField(
        required=False,
        allow_empty_file=True,
        help_text="A car's model.tar.gz, a training's folder as .tar.gz or .zip, a zip of an ONNX and its metadata, "
        "or the zip of stable-baselines3.",
    )
    model = serializers.FileField(required=False, allow_empty_file=True, help_text="An ONNX file or a frozen graph.")
    metadata = serializers.FileField(required=False, allow_empty_file=True, help_text="Its model_metadata.json.")
    weights = serializers.FileField(
        required=False, allow_empty_file=True, help_text="The .onnx.data file, of a model that keeps its weights there."
    )
    checkpoint = serializers.CharField(
        required=False,
        allow_blank=True,
        max_length=20,
        help_text="Of a training's folder: best, last, or the number in model_<number>.pb. The best by "
        "deepracer_checkpoints.json, else the last, unless given.",
    )
    name = serializers.CharField(
        required=False,
        allow_blank=True,
        validators=[visible_line],
        help_text="At most 64 characters; the file's name unless given.",
    )
    description = serializers.CharField(
        required=False, allow_blank=True, validators=[visible_line], help_text="At most 255 characters."
    )


class SentUpload(TypedDict, total=False):
    """What :class:`UploadSerializer` reads."""

    package: UploadedFile
    model: UploadedFile
    metadata: UploadedFile
    weights: UploadedFile
    checkpoint: str
    name: str
    description: str


class DescriptionSerializer(Body):
    """What may be changed of a model."""

    name = serializers.CharField(
        required=False, allow_blank=True, validators=[visible_line], help_text="1 to 64 characters."
    )
    description = serializers.CharField(
        required=False, allow_blank=True, validators=[visible_line], help_text="At most 255 characters."
    )
    shell = serializers.CharField(required=False, help_text=f"In replays; one of {', '.join(Shell.values)}.")
    colour = serializers.CharField(required=False, help_text="In replays, as #rrggbb.")
    shared = serializers.BooleanField(
        required=False, help_text="Let every racer look at it, download it and train on from its weights, or stop it."
    )


def own_model(request: Request, public_id: str) -> TrainedModel:
    return get_object_or_404(models_of(request.user), public_id=public_id)


def _visible_model(request: Request, public_id: str) -> TrainedModel:
    return get_object_or_404(visible_models(request.user), public_id=public_id)


class ModelsView(PrivateView):
    token_scope = RACE
    slow_methods = ("POST",)
    parser_classes = [MultiPartParser]
    throttle_scope = "upload"
    throttle_refused_scope = "refused_upload"

    def get_throttles(self) -> list:
        if not hasattr(self, "_throttles"):
            self._throttles = super().get_throttles()
        return self._throttles

    def finalize_response(self, request: Request, response: Response, *args: object, **kwargs: object) -> Response:
        response = super().finalize_response(request, response, *args, **kwargs)
        if 400 <= response.status_code < 500 and response.status_code != status.HTTP_429_TOO_MANY_REQUESTS:
            for throttle in self.get_throttles():
                throttle.count_as_refused()
        return response

    @operation("list_models", "My models", query=GarageFilter, answer=GarageModelSerializer, paged=True)
    def get(self, request: Request, asked: GarageQuery) -> QuerySet[TrainedModel]:
        shared = asked["shared"]
        models = garage_of(request.user, search=asked["search"], sort=asked["sort"])
        return models if shared is None else models.filter(shared_at__isnull=not shared)

    @operation(
        "upload_model",
        "Upload a model",
        body=UploadSerializer,
        answer={201: UploadedSerializer, 200: UploadedSerializer},
        description="Reads, converts and checks it before it answers: 201 with the new model, 200 with the one that "
        "is in your garage already when the network is the same, or the reason why it is refused.",
    )
    def post(self, request: Request, sent: SentUpload) -> Response:
        owner, files = racer_of(request), _parts(sent)
        name, description = sent.get("name"), sent.get("description", "")
        admitted = services.admit_upload(
            owner=owner, files=files, name=name, description=description, checkpoint=sent.get("checkpoint", "")
        )

        def make() -> Response:
            uploaded = services.upload_model(
                owner=owner,
                files=files,
                name=name,
                description=description,
                admitted=admitted,
                keep_upload=True,
                now=timezone.now(),
            )
            made = status.HTTP_201_CREATED if uploaded.created else status.HTTP_200_OK
            return Response(UploadedSerializer(uploaded).data, status=made)

        return self.write(make)


class SharedModelsView(PrivateView):
    @operation(
        "list_shared_models",
        "Shared models",
        query=SharedFilter,
        answer=ModelSerializer,
        paged=True,
        description="What racers share and the house's cars, the latest first.",
    )
    def get(self, request: Request, asked: dict[str, str]) -> QuerySet[TrainedModel]:
        models = shared_models(request.user)
        return models.filter(owner__alias__iexact=asked["racer"]) if asked else models


class ModelPackageView(PrivateView, FileView):
    @operation(
        "download_model",
        "A model as a package",
        find=_visible_model,
        answer=ZIP,
        description="A zip of the canonical ONNX and its model_metadata.json, of a model of yours or a shared one.",
    )
    def get(self, request: Request, model: TrainedModel) -> HttpResponseBase:
        return download_of(model)


class ModelExportView(PrivateView, FileView):
    media_type = "application/gzip"

    @operation(
        "export_model",
        "A model for a car or for OpenVINO",
        answer={(200, "application/gzip"): OpenApiTypes.BINARY},
        description="A model of yours or a shared one, as a .tar.gz. car: agent/model.pb, a frozen TensorFlow graph "
        "with the names that cars look for; openvino: model.xml and model.bin. Each with its model_metadata.json.",
        parameters=[OpenApiParameter("form", str, OpenApiParameter.PATH, enum=EXPORTS)],
    )
    def get(self, request: Request, public_id: str, form: str) -> HttpResponseBase:
        model = _visible_model(request, public_id)
        if form not in EXPORTS:
            raise Http404
        return export_of(model, form, racer_pk=racer_of(request).pk)


class ModelUploadView(PrivateView, FileView):
    media_type = "application/octet-stream"

    @operation(
        "download_model_upload",
        "The file that a model was uploaded as",
        find=own_model,
        answer={(200, "application/octet-stream"): OpenApiTypes.BINARY},
        description="To the byte, for its owner; several files as one zip. A model that was made here has none, nor "
        "has one that was uploaded before such files were kept.",
    )
    def get(self, request: Request, model: TrainedModel) -> HttpResponseBase:
        return upload_of(model)


class ModelView(PrivateView):
    token_scope = RACE
    parser_classes = [JSONParser]

    @operation("read_model", "A model", find=_visible_model, answer=ModelSerializer)
    def get(self, request: Request, model: TrainedModel) -> TrainedModel:
        return model

    @operation(
        "describe_model",
        "Change a model's name, description or look, or share it",
        find=own_model,
        body=DescriptionSerializer,
        answer=ModelSerializer,
    )
    def patch(self, request: Request, model: TrainedModel, sent: dict) -> TrainedModel:
        with transaction.atomic():
            services.describe_model(
                model=model,
                name=sent.get("name", model.name),
                description=sent.get("description", model.description),
                look=VehicleLook(sent.get("shell", model.shell), sent.get("colour", model.colour).lower()),
            )
            if sent.get("shared") is True:
                services.share_model(model=model, now=timezone.now())
            elif sent.get("shared") is False:
                services.stop_sharing_model(model=model)
        return model

    @operation(
        "delete_model", "Take a model out of the garage", find=own_model, answer="What it reached on boards stays."
    )
    def delete(self, request: Request, model: TrainedModel) -> None:
        services.delete_model(model=model, now=timezone.now())


def _parts(sent: Mapping[str, Any]) -> list[UploadPart]:
    """The uploaded files. Raises UserFault("upload_parts") for a package with a network beside it."""
    if "package" in sent and ("model" in sent or "weights" in sent):
        raise UserFault("upload_parts")
    parts = [UploadPart(sent[key].name, sent[key]) for key in ("package", "model", "metadata") if key in sent]
    if "weights" in sent:
        name = sent["weights"].name
        parts.append(UploadPart(name if is_weights_file(name) else f"{name}.data", sent["weights"]))
    return parts
