"""Reports through the API: ask for one, list them, read, stop, repeat, delete."""

from typing import Required, TypedDict

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ReasonField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from paddock.errors import UserFault
from paddock.rules.report import KINDS, MOST_SEED, kind_of, percent_of
from tracks.models import Track
from tracks.selectors import nearest_names, track_named

from ..garage.api import ModelSummarySerializer
from ..models import State
from ..models.reports import CarReport, ReportLap, TrackSet
from . import services
from .grading import GRADES
from .planning import MOST_TRACKS
from .selectors import can_stop_report, figures_of, is_report_of, reportable_model, reports_of, reports_visible_to


class ReportSerializer(serializers.Serializer):
    """A report in a list."""

    public_id = serializers.CharField()
    state = serializers.ChoiceField(State.choices)
    model = ModelSummarySerializer()
    track_set = serializers.ChoiceField(TrackSet.choices)
    variations_on = serializers.CharField(
        source="variations_on.slug", default=None, allow_null=True, help_text="The track whose lap is varied: its slug."
    )
    direction = serializers.CharField(allow_blank=True, help_text="Of the varied laps: ccw or cw; empty without any.")
    seed = serializers.IntegerField()
    driven = serializers.IntegerField(help_text="Laps that are driven already.")
    laps_in_all = serializers.IntegerField()
    grade = serializers.ChoiceField(
        [*[each.name for each in GRADES], ""], help_text="Of robustness; empty before the end, and without variations."
    )
    runs_sha256 = serializers.CharField(
        allow_blank=True, help_text="Over all laps: the same for the same model, tracks, seed and engine."
    )
    engine = serializers.CharField(allow_blank=True)
    reason = ReasonField(help_text="When it failed.")
    asked_at = serializers.DateTimeField()
    ended_at = serializers.DateTimeField(allow_null=True)


class ReportLapSerializer(serializers.Serializer):
    """One lap. Figures are null before it is driven."""

    number = serializers.IntegerField()
    track = serializers.CharField(source="track.slug")
    direction = serializers.CharField(help_text="ccw or cw.")
    variation = serializers.IntegerField(allow_null=True, help_text="0 to 99; null for the track as it is.")
    kind = serializers.SerializerMethodField(help_text="What is other than usual; null for nothing.")
    strength_percent = serializers.SerializerMethodField()
    complete = serializers.BooleanField(allow_null=True)
    time_ms = serializers.IntegerField(allow_null=True, help_text="Of the lap, or until it ended.")
    percent = serializers.FloatField(allow_null=True, help_text="How much of the lap was driven.")
    status = serializers.CharField(allow_blank=True, help_text="How it ended, in the words of sim-traces.")
    trace_sha256 = serializers.CharField(allow_blank=True)

    @extend_schema_field(serializers.CharField(allow_null=True))
    def get_kind(self, lap: ReportLap) -> str | None:
        return None if lap.variation is None else kind_of(lap.variation)

    @extend_schema_field(serializers.IntegerField(allow_null=True))
    def get_strength_percent(self, lap: ReportLap) -> int | None:
        return None if lap.variation is None else percent_of(lap.variation)


class KindSummarySerializer(serializers.Serializer):
    """What came of one kind of variation, or of all."""

    kind = serializers.CharField(allow_blank=True, help_text=f"One of {', '.join(KINDS)}; empty: all of them.")
    driven = serializers.IntegerField()
    completed = serializers.IntegerField()
    copes_percent = serializers.IntegerField(help_text="Up to which strength every one was completed.")
    best_ms = serializers.IntegerField(allow_null=True)
    median_ms = serializers.IntegerField(allow_null=True)
    spread_permille = serializers.IntegerField(
        allow_null=True, help_text="From the tenth to the ninetieth per cent of completed laps, of the middle one."
    )


class RobustnessSerializer(serializers.Serializer):
    """What the variations say."""

    grade = serializers.ChoiceField([each.name for each in GRADES])
    overall = KindSummarySerializer()
    kinds = KindSummarySerializer(many=True)


class ReportDetailSerializer(ReportSerializer):
    """A report with its laps."""

    robustness = serializers.SerializerMethodField(help_text="Once it is finished, where it has variations.")
    laps = ReportLapSerializer(many=True, source="driven_laps")

    @extend_schema_field(RobustnessSerializer(allow_null=True))
    def get_robustness(self, report: CarReport) -> dict[str, object] | None:
        if report.state != State.FINISHED:
            return None
        found = figures_of(report).robustness
        return None if found is None else RobustnessSerializer(found).data


class NewReportSerializer(Body):
    """A report: a model, and what it drives."""

    model = serializers.CharField(max_length=12, help_text="A model of yours, or one that is shared: its public id.")
    track_set = serializers.ChoiceField(
        TrackSet.choices, required=False, help_text="Each track is driven in both directions; league unless given."
    )
    tracks = serializers.ListField(
        child=serializers.CharField(max_length=64),
        required=False,
        max_length=MOST_TRACKS,
        help_text="Slugs, for the set chosen.",
    )
    variations_on = serializers.CharField(
        max_length=64, required=False, allow_null=True, help_text="The slug of the track whose lap is varied."
    )
    direction = serializers.CharField(
        max_length=3, required=False, help_text="Of the varied laps: ccw or cw; the file's own unless given."
    )
    seed = serializers.IntegerField(min_value=0, max_value=MOST_SEED, required=False)


class SentReport(TypedDict, total=False):
    """What :class:`NewReportSerializer` reads."""

    model: Required[str]
    track_set: str
    tracks: list[str]
    variations_on: str | None
    direction: str
    seed: int


class ReportFilterSerializer(serializers.Serializer):
    """Which reports to list."""

    state = serializers.ChoiceField(State.choices, required=False)
    model = serializers.CharField(required=False, max_length=12, help_text="The model's public id.")


def _visible(request: Request, public_id: str) -> CarReport:
    return get_object_or_404(reports_visible_to(request.user), public_id=public_id)


def _mine(request: Request, public_id: str) -> CarReport:
    report = _visible(request, public_id)
    if not is_report_of(request.user, report):
        raise PermissionDenied()
    return report


def _with_laps(request: Request, public_id: str) -> CarReport:
    report = _visible(request, public_id)
    report.driven_laps = list(report.laps.select_related("track").defer("track__npy").order_by("number"))  # type: ignore[attr-defined]
    return report


class ReportsView(PrivateView):
    token_scope = RACE

    @operation(
        "list_reports",
        "Your reports on cars",
        query=ReportFilterSerializer,
        answer=ReportSerializer,
        paged=True,
        description="The latest first.",
    )
    def get(self, request: Request, asked: dict[str, str]) -> QuerySet[CarReport]:
        ways = {"state": "state", "model": "model__public_id"}
        return reports_of(request.user).filter(**{ways[name]: value for name, value in asked.items()})

    @operation(
        "create_report",
        "Drive a car on many tracks and under a hundred variations of a lap",
        description="Private: only you and admins see it. It waits behind races and runs, and counts in none.",
        body=NewReportSerializer,
        answer=ReportDetailSerializer,
        status=201,
    )
    def post(self, request: Request, sent: SentReport) -> CarReport:
        racer, varied = racer_of(request), sent.get("variations_on")
        made = services.request_report(
            owner=racer,
            model=reportable_model(racer, sent["model"]),
            track_set=sent.get("track_set", TrackSet.LEAGUE),
            tracks=[_track(slug) for slug in sent.get("tracks", ())],
            variations_on=None if varied is None else _track(varied),
            direction=sent.get("direction", ""),
            seed=sent.get("seed", 0),
            now=timezone.now(),
        )
        return _with_laps(request, made.public_id)


class ReportView(PrivateView):
    token_scope = RACE

    @operation("get_report", "A report, with its laps", find=_with_laps, answer=ReportDetailSerializer)
    def get(self, request: Request, report: CarReport) -> CarReport:
        return report

    @operation("delete_report", "Delete a report of yours that is over", find=_mine, answer="")
    def delete(self, request: Request, report: CarReport) -> None:
        services.delete_report(report=report, now=timezone.now())


class ReportStopView(APIView):
    token_scope = RACE

    @operation(
        "stop_report",
        "Stop a report that waits or is driven",
        description="An ended report stays unchanged.",
        find=_visible,
        answer=ReportDetailSerializer,
    )
    def post(self, request: Request, report: CarReport) -> CarReport:
        if can_stop_report(request.user, report):
            services.stop_report(report=report, now=timezone.now())
        return _with_laps(request, report.public_id)


class ReportAgainView(APIView):
    token_scope = RACE

    @operation(
        "repeat_report",
        "Drive a report of yours again",
        description="The same car on the same tracks, from the same seed.",
        find=_mine,
        answer=ReportDetailSerializer,
        status=201,
    )
    def post(self, request: Request, report: CarReport) -> CarReport:
        made = services.drive_report_again(report=report, now=timezone.now())
        return _with_laps(request, made.public_id)


def _track(slug: str) -> Track:
    track = track_named(slug)
    if track is None:
        raise UserFault("report_track_gone", track=slug, nearest=nearest_names(slug))
    return track
