"""One lap against another, as numbers."""

from __future__ import annotations

from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from evaluation.models import Evaluation
from evaluation.services.results import read_trace
from paddock.errors import UserFault

from ..comparing import LapLine, best_lap, compare, lap_line
from ..selectors.comparable import refuse_incomparable
from .lookup import visible_evaluation


class LapComparisonSerializer(serializers.Serializer):
    """One lap against another along the way."""

    lap = serializers.IntegerField(help_text="Of the first run.")
    other_lap = serializers.IntegerField(help_text="Of the other run.")
    length_m = serializers.FloatField(help_text="Of a lap.")
    metres = serializers.ListField(
        child=serializers.FloatField(), help_text="From the line, half a percent of a lap apart, as far as both came."
    )
    gap_ms = serializers.ListField(
        child=serializers.IntegerField(),
        help_text="How much later the other was there: more than 0 where the first run is ahead.",
    )
    speed = serializers.ListField(child=serializers.FloatField(), help_text="Commanded in the first run, m/s.")
    other_speed = serializers.ListField(child=serializers.FloatField(), help_text="Commanded in the other run, m/s.")


class CompareView(APIView):
    """Comparing."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="compare_evaluations",
        summary="The gap between a lap of one run and a lap of another, along the way",
        description="Both runs must be on the same track in the same direction, and you must see both.",
        parameters=[
            OpenApiParameter("lap", int, description="Of the first run; its best one unless it is given."),
            OpenApiParameter("other_lap", int, description="Of the other run; its best one unless it is given."),
        ],
        responses=LapComparisonSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str, other_id: str) -> Response:
        one, other = visible_evaluation(request, public_id), visible_evaluation(request, other_id)
        refuse_incomparable(one, other)
        lines = _line(request, "lap", one), _line(request, "other_lap", other)
        return Response(LapComparisonSerializer(compare(*lines, one.track.geometry.length)).data)


def _line(request: Request, name: str, run: Evaluation) -> LapLine:
    laps = run.result.laps
    asked = request.query_params.get(name, "")
    if not asked:
        return lap_line(read_trace(run.result), laps, best_lap(laps))
    if not (asked.isascii() and asked.isdecimal() and len(asked) < 4):
        raise UserFault("compare_lap", lap=asked[:20], laps=len(laps))
    return lap_line(read_trace(run.result), laps, int(asked))
