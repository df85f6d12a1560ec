"""Evaluations: state, results and files in common formats."""

from typing import Annotated, Any, TypedDict

from django.http import HttpResponse, HttpResponseBase
from django.utils import timezone
from django.utils.translation import gettext as _
from drf_spectacular.utils import OpenApiParameter
from rest_framework import serializers
from rest_framework.exceptions import NotFound, PermissionDenied
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.documents import serializer_of
from core.api.fields import ComputedField, ReasonField
from core.api.operations import ZIP, csv_of, operation
from core.api.views import APIView, FileView
from evaluation.garage.api import ModelSummarySerializer
from evaluation.garage.downloads import logs_of
from evaluation.models import CompetitorResult, Evaluation, Result, State
from evaluation.running.queue.selectors import expected_wait_s, queue_length, queue_position
from evaluation.running.queue.services import stop_evaluation
from evaluation.running.results import read_layout, read_trace
from paddock.errors import UserFault
from paddock.rules.ranked import RANKED
from paddock.simulator.results import LapDocument, Progress

from ...models import OwnEvaluation
from ...rules.serializers import with_rules
from ...test_runs.selectors import can_stop_run, own_of, own_result, seen_race_of
from ...test_runs.services import delete_own
from ...web.api import visible_evaluation
from ...web.serializers import NamedSerializer, PlacedBoxSerializer, TrackSummarySerializer
from ...web.views import downloaded
from ..video_titles import race_of

CAR = OpenApiParameter("car", int, description="The number of a rival; 0, the first car, unless it is given.")


class QueueDocument(TypedDict):
    """The place of an evaluation in the queue."""

    position: Annotated[int, "1 is the next to run; 1001 is any place behind the first 1,000."]
    waiting: Annotated[int, "Length of the queue; 1001 for more than 1,000."]
    expected_wait_s: Annotated[
        float | None, "Until its probable end, from recent runs; behind the first 1,000, at least."
    ]


def queue_document(evaluation: Evaluation) -> QueueDocument | None:
    """None unless the evaluation waits."""
    position = queue_position(evaluation)
    if position is None:
        return None
    wait_s = expected_wait_s(evaluation, position)
    return {"position": position, "waiting": queue_length(), "expected_wait_s": wait_s and round(wait_s, 1)}


class CompetitorResultSerializer(serializers.Serializer):
    """The result of one car."""

    laps = serializer_of(LapDocument, "Lap")(many=True)
    end_reason = serializers.CharField(help_text="laps_done, time_up, resets_used or, among several cars, retired.")
    retired = ReasonField("retired", help_text="Why it was taken off the track while others drove on.")
    complete_laps = serializers.IntegerField()
    best_lap_ms = serializers.IntegerField(allow_null=True)
    total_ms = serializers.IntegerField(help_text="Of all laps, complete or not.")
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    resets = serializers.IntegerField()
    trace_sha256 = serializers.CharField(help_text="The same cars in the same race give the same number, every time.")
    trajectory = serializers.ListField(
        child=serializers.ListField(child=serializers.ListField(child=serializers.FloatField())),
        help_text="The trajectory, for each lap a thinned list of [x, y, speed] in metres and m/s.",
    )


class RivalResultSerializer(CompetitorResultSerializer):
    """The result of another submitted car."""

    number = serializers.IntegerField(help_text="Of the car, as in rivals.")


class ResultSerializer(CompetitorResultSerializer):
    """The measured result; of several submitted cars that of the first, with the others in ``rivals``."""

    simulated_ms = serializers.IntegerField()
    wall_s = serializers.FloatField()
    peak_mb = serializers.FloatField()
    engine = serializers.CharField()
    versions = serializers.DictField(child=serializers.CharField())
    cpu_model = serializers.CharField(allow_blank=True)
    boxes = PlacedBoxSerializer(source="layout.boxes", many=True, default=[])
    order = serializers.ListField(child=serializers.IntegerField(), help_text="The cars' numbers, winner first.")
    rivals = RivalResultSerializer(many=True)


class RivalSerializer(serializers.Serializer):
    """Another submitted car in the same race; the evaluation's own model is car 0."""

    number = serializers.IntegerField()
    racer = serializers.CharField(source="model.owner.alias")
    model = ModelSummarySerializer()


class WouldBeSerializer(serializers.Serializer):
    """The result of a run in a race, if it were submitted now."""

    rank = serializers.IntegerField()
    racers = serializers.IntegerField(help_text="Number of racers, this one included.")
    is_better = serializers.BooleanField(source="change.is_better", help_text="Than what you have in the race.")


class OwnSerializer(with_rules(serializers.Serializer, RANKED)):  # type: ignore[misc]
    """The additional data of a test drive."""

    race = ComputedField(
        NamedSerializer(allow_null=True),
        seen_race_of,
        help_text="The race that it was driven as in, as long as you see it.",
    )
    classified = serializers.BooleanField(
        source="worth.standing.classified", default=None, allow_null=True, help_text="Once it has a result."
    )
    score_ms = serializers.IntegerField(
        source="worth.standing.score_ms",
        default=None,
        allow_null=True,
        help_text="By the ranking method; null unless it is classified.",
    )
    would_be = WouldBeSerializer(
        source="worth.would_be",
        default=None,
        allow_null=True,
        read_only=True,
        help_text="In its race, against the board as it is now.",
    )
    submit_if_better = serializers.BooleanField()
    submitted = serializers.CharField(
        source="submission.evaluation.public_id", default=None, allow_null=True, help_text="The run in the race."
    )
    submit_reason = ReasonField("submit_reason", help_text="Why it was not submitted.")

    def to_representation(self, own: OwnEvaluation) -> dict[str, object]:
        result = getattr(own.evaluation, "result", None)
        own.worth = None if result is None else own_result(own, result)
        return super().to_representation(own)


class EvaluationSerializer(serializers.Serializer):
    """One run of one model."""

    public_id = serializers.CharField()
    state = serializers.ChoiceField(State.choices)
    racer = serializers.CharField(source="owner.alias")
    model = ModelSummarySerializer()
    rivals = ComputedField(
        RivalSerializer(many=True),
        lambda evaluation: evaluation.rivals.select_related("model__owner"),
        help_text="Other submitted cars in the same race.",
    )
    race = ComputedField(NamedSerializer(allow_null=True), race_of)
    submission = serializers.IntegerField(
        source="submission.number",
        default=None,
        allow_null=True,
        read_only=True,
        help_text="The number of the submission it measures.",
    )
    own = OwnSerializer(default=None, allow_null=True, read_only=True, help_text="Of a test run.")
    track = TrackSummarySerializer()
    rules = serializers.DictField(source="spec.rules", read_only=True, help_text="Frozen when it was queued.")
    queue = ComputedField(serializer_of(QueueDocument)(allow_null=True), queue_document, help_text="While it waits.")
    progress = ComputedField(
        serializer_of(Progress)(allow_null=True),
        lambda evaluation: (evaluation.state == State.RUNNING and evaluation.progress) or None,
        help_text="While it runs.",
    )
    reason = ReasonField(help_text="When it failed or was stopped.")
    attempt = serializers.IntegerField()
    queued_at = serializers.DateTimeField()
    started_at = serializers.DateTimeField(allow_null=True)
    ended_at = serializers.DateTimeField(allow_null=True)
    result = ResultSerializer(default=None, allow_null=True, read_only=True, help_text="When it is finished.")


class MetricSerializer(serializers.Serializer):
    """One lap in the field's own keys (times in simulated milliseconds)."""

    trial = serializers.IntegerField()
    completion_percentage = serializers.IntegerField()
    metric_time = serializers.IntegerField()
    start_time = serializers.IntegerField()
    elapsed_time_in_milliseconds = serializers.IntegerField()
    episode_status = serializers.CharField()
    crash_count = serializers.IntegerField()
    immobilized_count = serializers.IntegerField()
    off_track_count = serializers.IntegerField()
    reversed_count = serializers.IntegerField()
    reset_count = serializers.IntegerField()


class MetricsSerializer(serializers.Serializer):
    """The field's evaluation metrics file."""

    metrics = MetricSerializer(many=True)


def stoppable_evaluation(request: Request, public_id: str) -> Evaluation:
    """An evaluation that the reader may stop, or that has ended. Raises Http404, PermissionDenied."""
    evaluation = visible_evaluation(request, public_id)
    if not (evaluation.is_final or can_stop_run(request.user, evaluation)):
        raise PermissionDenied()
    return evaluation


def own_run(request: Request, public_id: str) -> OwnEvaluation:
    """The reader's own run. Raises Http404, UserFault("own_only")."""
    return own_of(racer_of(request), visible_evaluation(request, public_id))


def _result(request: Request, public_id: str) -> Result:
    result = getattr(visible_evaluation(request, public_id), "result", None)
    if result is None:
        raise NotFound(_("This evaluation has no result."))
    return result


def _car(request: Request, public_id: str) -> tuple[CompetitorResult, str]:
    """The result of the car in ``?car=``, and how its files are named. Raises Http404, NotFound,
    UserFault("car_number")."""
    result = _result(request, public_id)
    wanted = request.query_params.get("car", "0")
    if wanted == "0":
        return result, public_id
    rival = next((rival for rival in result.rivals.all() if str(rival.number) == wanted), None)
    if rival is None:
        known = ["0", *sorted(str(rival.number) for rival in result.rivals.all())]
        raise UserFault("car_number", car=wanted[:20], known=", ".join(known))
    return rival, f"{public_id}-car{rival.number}"


class EvaluationView(APIView):
    token_scope = RACE

    @operation(
        "read_evaluation",
        "An evaluation: state, place in the queue, progress, reason, result",
        find=visible_evaluation,
        answer=EvaluationSerializer,
        description=(
            "Yours, those of races that you organise, and for races that you may see those that stand on the board "
            "and the duels."
        ),
    )
    def get(self, request: Request, evaluation: Evaluation) -> Evaluation:
        return evaluation

    @operation(
        "delete_evaluation",
        "Delete one of your ended test runs",
        find=own_run,
        answer="",
        description="With its result, its videos and its files. Submissions made from it remain.",
    )
    def delete(self, request: Request, own: OwnEvaluation) -> None:
        delete_own(own=own, now=timezone.now())


class StopView(APIView):
    token_scope = RACE

    @operation(
        "stop_evaluation",
        "Stop an evaluation of yours that waits or runs",
        find=stoppable_evaluation,
        answer=EvaluationSerializer,
        description="An ended evaluation stays unchanged.",
    )
    def post(self, request: Request, evaluation: Evaluation) -> Evaluation:
        if not evaluation.is_final:
            stop_evaluation(evaluation=evaluation, now=timezone.now())
        return evaluation


class MetricsView(APIView):
    @operation(
        "read_metrics",
        "The evaluation metrics JSON of a finished evaluation",
        find=_car,
        answer={200: MetricsSerializer},
        parameters=[CAR],
    )
    def get(self, request: Request, found: tuple[CompetitorResult, str]) -> Response:
        car, name = found
        return Response(car.metrics, headers={"Content-Disposition": f'attachment; filename="{name}-metrics.json"'})


class DrivenLayoutSerializer(serializers.Serializer):
    """Boxes and bots on the track besides submitted cars."""

    boxes = PlacedBoxSerializer(many=True)
    bots = serializers.ListField(
        child=serializers.ListField(child=serializers.ListField(child=serializers.FloatField())),
        help_text="For each bot car [x, y, yaw] (m, rad) in every line of the first car's sim-trace.",
    )


class LayoutView(APIView):
    @operation(
        "read_layout",
        "Positions of boxes and bot cars in a finished evaluation",
        find=_result,
        answer=DrivenLayoutSerializer,
    )
    def get(self, request: Request, result: Result) -> Any:
        return read_layout(result)


class TraceView(FileView):
    media_type = "text/csv"

    @operation(
        "read_trace",
        "The sim-trace CSV of a finished evaluation",
        find=_car,
        answer=csv_of("A line a control step."),
        parameters=[CAR],
    )
    def get(self, request: Request, found: tuple[CompetitorResult, str]) -> HttpResponse:
        car, name = found
        return downloaded(read_trace(car), f"{name}-sim-trace.csv", "text/csv; charset=utf-8")


class LogsView(FileView):
    @operation(
        "download_evaluation_logs",
        "All files of a finished evaluation as one zip",
        find=_result,
        answer=ZIP,
        description=(
            "Sim-trace, metrics and simulation log of every car, laid out as deepracer-utils looks for them; "
            "model_metadata.json too where you may see the model."
        ),
    )
    def get(self, request: Request, result: Result) -> HttpResponseBase:
        return logs_of(result.evaluation, request.user)
