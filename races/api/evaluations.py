"""Evaluations: how one goes, what it measured, its files in the field's own formats."""

from __future__ import annotations

from typing import Any

from django.http import HttpResponse, HttpResponseBase
from django.utils import timezone
from django.utils.translation import gettext as _
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, OpenApiResponse, extend_schema, extend_schema_field
from rest_framework import serializers, status
from rest_framework.exceptions import NotFound, PermissionDenied
from rest_framework.permissions import AllowAny, IsAuthenticated, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import refuse_fields
from core.file_view import FileView
from evaluation.files import logs_of
from evaluation.models import CompetitorResult, Evaluation, Result, State
from evaluation.selectors import expected_wait_s, queue_length, queue_position
from evaluation.services import stop_evaluation
from evaluation.services.results import read_layout, read_trace
from paddock.errors import UserFault
from paddock.errors.reasons import REASONS
from paddock.rules.ranked import RANKED

from ..models import OwnEvaluation
from ..rules.serializers import with_rules
from ..selectors.own import OwnResult, can_stop_run, own_of, own_result, seen_race_of
from ..services import delete_own
from ..video_words import race_of
from .lookup import visible_evaluation
from .placed import PlacedBoxSerializer
from .races import TrackSummarySerializer

CAR = OpenApiParameter("car", int, description="The number of a rival; 0, the first car, unless it is given.")


class NamedSerializer(serializers.Serializer):
    """Something with an address and a name."""

    slug = serializers.CharField()
    name = serializers.CharField()


class ModelSummarySerializer(serializers.Serializer):
    """Which model."""

    public_id = serializers.CharField()
    name = serializers.CharField()
    sha256 = serializers.CharField(source="network_id")


class ReasonSerializer(serializers.Serializer):
    """Why there is no result."""

    code = serializers.CharField()
    fault = serializers.ChoiceField(["user", "platform"], help_text="platform: it does not count, try again.")
    sentence = serializers.CharField()
    params = serializers.DictField()


class QueueSerializer(serializers.Serializer):
    """Where a waiting evaluation stands."""

    position = serializers.IntegerField(help_text="1 is the next to run; 1001 is any place behind the first 1,000.")
    waiting = serializers.IntegerField(help_text="All that wait; 1001 for more than 1,000.")
    expected_wait_s = serializers.FloatField(
        allow_null=True, help_text="Until its probable end, from recent runs; behind the first 1,000, at least."
    )


class RivalProgressSerializer(serializers.Serializer):
    """How another submitted car stands."""

    lap = serializers.IntegerField()
    percent = serializers.FloatField()
    total_ms = serializers.IntegerField()
    x = serializers.FloatField()
    y = serializers.FloatField()
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    retired = serializers.BooleanField()


class ProgressSerializer(serializers.Serializer):
    """How it stands while it runs."""

    lap = serializers.IntegerField()
    laps = serializers.IntegerField()
    lap_ms = serializers.IntegerField()
    total_ms = serializers.IntegerField()
    percent = serializers.FloatField()
    x = serializers.FloatField()
    y = serializers.FloatField()
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    resets = serializers.IntegerField()
    last_lap_ms = serializers.IntegerField(allow_null=True)
    bots = serializers.ListField(child=serializers.ListField(child=serializers.FloatField()), help_text="x, y of each.")
    rivals = RivalProgressSerializer(many=True)


class LapSerializer(serializers.Serializer):
    """One lap; times in whole simulated milliseconds."""

    number = serializers.IntegerField()
    start_ms = serializers.IntegerField()
    time_ms = serializers.IntegerField()
    complete = serializers.BooleanField()
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    resets = serializers.IntegerField()
    immobilised = serializers.IntegerField()
    reversals = serializers.IntegerField()
    sector_ms = serializers.ListField(child=serializers.IntegerField(), help_text="Three when the lap is complete.")
    completion_percentage = serializers.IntegerField()
    status = serializers.CharField()


class CompetitorResultSerializer(serializers.Serializer):
    """What one car did."""

    laps = LapSerializer(many=True)
    end_reason = serializers.CharField(help_text="laps_done, time_up, resets_used or, among several cars, retired.")
    retired = serializers.SerializerMethodField(help_text="Why it was taken off the track while others drove on.")
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

    @extend_schema_field(ReasonSerializer(allow_null=True))
    def get_retired(self, result: CompetitorResult) -> dict[str, Any] | None:
        return reason_of(result.retired_code, result.retired, result.retired_params)


class RivalResultSerializer(CompetitorResultSerializer):
    """What another submitted car did."""

    number = serializers.IntegerField(help_text="Of the car, as in rivals.")


class ResultSerializer(CompetitorResultSerializer):
    """What was measured; of several submitted cars, what the first did, with the others in ``rivals``."""

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
    """What a run would be in a race, if it were sent there now."""

    rank = serializers.IntegerField()
    racers = serializers.IntegerField(help_text="Of so many, this one among them.")
    is_better = serializers.BooleanField(source="change.is_better", help_text="Than what you have in the race.")


class OwnSerializer(with_rules(serializers.Serializer, RANKED)):  # type: ignore[misc]
    """What a run of one's own is besides."""

    race = serializers.SerializerMethodField(help_text="The race that it was driven as in, as long as you see it.")
    classified = serializers.SerializerMethodField(help_text="Once it has a result.")
    score_ms = serializers.SerializerMethodField(help_text="By the ranking method; null unless it is classified.")
    would_be = serializers.SerializerMethodField(help_text="In its race, against the board as it is now.")
    submit_if_better = serializers.BooleanField()
    submitted = serializers.CharField(
        source="submission.evaluation.public_id", default=None, allow_null=True, help_text="The run in the race."
    )
    submit_reason = serializers.SerializerMethodField(help_text="Why it was not submitted, though that was wished for.")

    @extend_schema_field(NamedSerializer(allow_null=True))
    def get_race(self, own: OwnEvaluation) -> dict[str, Any] | None:
        race = seen_race_of(own)
        return None if race is None else NamedSerializer(race).data

    def get_classified(self, own: OwnEvaluation) -> bool | None:
        worth = self._worth(own)
        return None if worth is None else worth.standing.classified

    def get_score_ms(self, own: OwnEvaluation) -> int | None:
        worth = self._worth(own)
        return None if worth is None else worth.standing.score_ms

    @extend_schema_field(WouldBeSerializer(allow_null=True))
    def get_would_be(self, own: OwnEvaluation) -> dict[str, Any] | None:
        worth = self._worth(own)
        return None if worth is None or worth.would_be is None else WouldBeSerializer(worth.would_be).data

    @extend_schema_field(ReasonSerializer(allow_null=True))
    def get_submit_reason(self, own: OwnEvaluation) -> dict[str, Any] | None:
        return reason_of(own.submit_reason_code, own.submit_reason, own.submit_reason_params)

    def _worth(self, own: OwnEvaluation) -> OwnResult | None:
        if not hasattr(self, "_worked_out"):
            result = getattr(own.evaluation, "result", None)
            self._worked_out = None if result is None else own_result(own, result)
        return self._worked_out


class EvaluationSerializer(serializers.Serializer):
    """One run of one model."""

    public_id = serializers.CharField()
    state = serializers.ChoiceField(State.choices)
    racer = serializers.CharField(source="owner.alias")
    model = ModelSummarySerializer()
    rivals = serializers.SerializerMethodField(help_text="Other submitted cars in the same race.")
    race = serializers.SerializerMethodField()
    submission = serializers.SerializerMethodField(help_text="The number of the submission it measures.")
    own = serializers.SerializerMethodField(help_text="Of a run that its racer asked for themselves.")
    track = TrackSummarySerializer()
    rules = serializers.SerializerMethodField(help_text="As they stood when it was sent.")
    queue = serializers.SerializerMethodField(help_text="While it waits.")
    progress = serializers.SerializerMethodField(help_text="While it runs.")
    reason = serializers.SerializerMethodField(help_text="When it failed or was stopped.")
    attempt = serializers.IntegerField()
    queued_at = serializers.DateTimeField()
    started_at = serializers.DateTimeField(allow_null=True)
    ended_at = serializers.DateTimeField(allow_null=True)
    result = serializers.SerializerMethodField(help_text="When it is finished.")

    @extend_schema_field(RivalSerializer(many=True))
    def get_rivals(self, evaluation: Evaluation) -> list[dict[str, Any]]:
        return list(RivalSerializer(evaluation.rivals.select_related("model__owner"), many=True).data)

    @extend_schema_field(NamedSerializer(allow_null=True))
    def get_race(self, evaluation: Evaluation) -> dict[str, Any] | None:
        race = race_of(evaluation)
        return None if race is None else NamedSerializer(race).data

    def get_submission(self, evaluation: Evaluation) -> int | None:
        submission = getattr(evaluation, "submission", None)
        return None if submission is None else submission.number

    @extend_schema_field(OwnSerializer(allow_null=True))
    def get_own(self, evaluation: Evaluation) -> dict[str, Any] | None:
        own = getattr(evaluation, "own", None)
        return None if own is None else OwnSerializer(own).data

    def get_rules(self, evaluation: Evaluation) -> dict[str, Any]:
        return evaluation.spec["rules"]

    @extend_schema_field(QueueSerializer(allow_null=True))
    def get_queue(self, evaluation: Evaluation) -> dict[str, Any] | None:
        position = queue_position(evaluation)
        if position is None:
            return None
        wait_s = expected_wait_s(evaluation, position)
        return QueueSerializer(
            {"position": position, "waiting": queue_length(), "expected_wait_s": wait_s and round(wait_s, 1)}
        ).data

    @extend_schema_field(ProgressSerializer(allow_null=True))
    def get_progress(self, evaluation: Evaluation) -> dict[str, Any] | None:
        if evaluation.state != State.RUNNING or not evaluation.progress:
            return None
        return ProgressSerializer(evaluation.progress).data

    @extend_schema_field(ReasonSerializer(allow_null=True))
    def get_reason(self, evaluation: Evaluation) -> dict[str, Any] | None:
        return reason_of(evaluation.reason_code, evaluation.reason, evaluation.reason_params)

    @extend_schema_field(ResultSerializer(allow_null=True))
    def get_result(self, evaluation: Evaluation) -> dict[str, Any] | None:
        result = getattr(evaluation, "result", None)
        return None if result is None else ResultSerializer(result).data


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


class EvaluationView(APIView):
    """One evaluation."""

    token_scope = RACE
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="read_evaluation",
        summary="An evaluation: state, place in the queue, progress, reason, result",
        description=(
            "Yours, those of races that you organise, and for races that you may see those that stand on the board "
            "and the duels."
        ),
        responses=EvaluationSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        return Response(EvaluationSerializer(visible_evaluation(request, public_id)).data)

    @extend_schema(
        operation_id="delete_evaluation",
        summary="Delete a run of your own that is over",
        description="With its result, its videos and its files. What was sent to a race because of it stays.",
        request=None,
        responses={204: None},
        tags=["evaluations"],
    )
    def delete(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        refuse_fields(request)
        own = own_of(racer_of(request), evaluation)
        delete_own(own=own, now=timezone.now())
        return Response(status=status.HTTP_204_NO_CONTENT)


class StopView(APIView):
    """Stopping an evaluation."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="stop_evaluation",
        summary="Stop an evaluation of yours that waits or runs",
        description="One that has ended already is left as it is.",
        request=None,
        responses=EvaluationSerializer,
        tags=["evaluations"],
    )
    def post(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        refuse_fields(request)
        if not evaluation.is_final:
            if not can_stop_run(request.user, evaluation):
                raise PermissionDenied()
            stop_evaluation(evaluation=evaluation, now=timezone.now())
        return Response(EvaluationSerializer(evaluation).data)


class MetricsView(APIView):
    """The metrics file."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_metrics",
        summary="The evaluation metrics JSON of a finished evaluation",
        parameters=[CAR],
        responses=MetricsSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        car, suffix = _car(request, public_id)
        return Response(car.metrics, headers=_as_file(f"{public_id}{suffix}-metrics.json"))


class DrivenLayoutSerializer(serializers.Serializer):
    """What stood and drove on the track besides submitted cars."""

    boxes = PlacedBoxSerializer(many=True)
    bots = serializers.ListField(
        child=serializers.ListField(child=serializers.ListField(child=serializers.FloatField())),
        help_text="For each bot car [x, y, yaw] (m, rad) in every line of the first car's sim-trace.",
    )


class LayoutView(APIView):
    """Boxes and bot cars."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_layout",
        summary="Where boxes stood and bot cars drove in a finished evaluation",
        responses=DrivenLayoutSerializer,
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> Response:
        return Response(read_layout(_result(request, public_id)))


class TraceView(FileView):
    """The trace file."""

    permission_classes = [AllowAny]
    media_type = "text/csv"

    @extend_schema(
        operation_id="read_trace",
        summary="The sim-trace CSV of a finished evaluation",
        parameters=[CAR],
        responses={(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description="A line a control step.")},
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponse:
        car, suffix = _car(request, public_id)
        headers = _as_file(f"{public_id}{suffix}-sim-trace.csv")
        return HttpResponse(read_trace(car), content_type="text/csv; charset=utf-8", headers=headers)


class LogsView(FileView):
    """All files in one."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="download_evaluation_logs",
        summary="All files of a finished evaluation as one zip",
        description=(
            "Sim-trace, metrics and simulation log of every car, laid out as deepracer-utils looks for them; "
            "model_metadata.json too where you may see the model."
        ),
        responses={(200, "application/zip"): OpenApiTypes.BINARY},
        tags=["evaluations"],
    )
    def get(self, request: Request, public_id: str) -> HttpResponseBase:
        return logs_of(_result(request, public_id).evaluation, request.user)


def _result(request: Request, public_id: str) -> Result:
    result = getattr(visible_evaluation(request, public_id), "result", None)
    if result is None:
        raise NotFound(_("This evaluation has no result."))
    return result


def _car(request: Request, public_id: str) -> tuple[CompetitorResult, str]:
    """The result of the car that ``?car=`` names, the first unless it does, and what a file's name says of it.

    Raises Http404, NotFound, UserFault("car_number").
    """
    result = _result(request, public_id)
    wanted = request.query_params.get("car", "0")
    if wanted == "0":
        return result, ""
    rival = next((rival for rival in result.rivals.all() if str(rival.number) == wanted), None)
    if rival is None:
        known = ["0", *sorted(str(rival.number) for rival in result.rivals.all())]
        raise UserFault("car_number", car=wanted[:20], known=", ".join(known))
    return rival, f"-car{rival.number}"


def reason_of(code: str, sentence: str, params: dict[str, Any]) -> dict[str, Any] | None:
    """A reason as the API tells it; None for none."""
    if not code:
        return None
    return ReasonSerializer({"code": code, "fault": REASONS[code].fault, "sentence": sentence, "params": params}).data


def _as_file(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
