"""One lap against another, as numbers."""

from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request

from core.api.documents import serializer_of
from core.api.operations import operation
from core.api.views import APIView
from evaluation.models import Evaluation

from ...replays.comparison import LapComparison, LapLine, compare, driven_trace, lap_line
from ...replays.selectors import refuse_incomparable
from ...telemetry.selectors import asked_number
from ...web.api import visible_evaluation


class CompareView(APIView):
    @operation(
        "compare_evaluations",
        "The gap between a lap of one run and a lap of another, along the way",
        answer=serializer_of(LapComparison),
        description="Both runs must be on the same track in the same direction, and you must see both.",
        parameters=[
            OpenApiParameter("lap", int, description="Of the first run; its best one unless it is given."),
            OpenApiParameter("other_lap", int, description="Of the other run; its best one unless it is given."),
        ],
    )
    def get(self, request: Request, public_id: str, other_id: str) -> LapComparison:
        one, other = visible_evaluation(request, public_id), visible_evaluation(request, other_id)
        refuse_incomparable(one, other)
        lines = _line(request, "lap", one), _line(request, "other_lap", other)
        return compare(*lines, one.track.geometry.length)


def _line(request: Request, name: str, run: Evaluation) -> LapLine:
    number = asked_number(run, request.query_params.get(name, ""))
    return lap_line(driven_trace(run.result), run.result.laps, number)
