"""Telemetry for programs."""

from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request
from rest_framework.response import Response

from core.api.documents import serializer_of
from core.api.operations import operation
from core.api.views import APIView
from evaluation.models import Evaluation

from ..web.api import visible_evaluation
from .document import TelemetryDocument, telemetry_document
from .selectors import asked_laps


class TelemetryView(APIView):
    @operation(
        "read_telemetry",
        "Laps of one or several runs along their way, with mini-sectors and losses",
        find=visible_evaluation,
        answer={200: serializer_of(TelemetryDocument)},
        description=(
            "Speed, steering, offset, curvature and time at places a tenth of a metre apart. All runs must be "
            "finished, on the same track in the same direction, by the same engine, and you must see them."
        ),
        parameters=[
            OpenApiParameter("lap", int, description="Of the run; its best one unless it is given."),
            OpenApiParameter("with", str, description="Up to seven others: `id`, `id:2` with a lap, `reference`."),
            OpenApiParameter("reward", int, description="1: with the rewards of runs of your trainings' models."),
        ],
    )
    def get(self, request: Request, run: Evaluation) -> Response:
        return Response(telemetry_document(asked_laps(request, run)))
