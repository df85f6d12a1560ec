"""What is left of a live event, and the results of a race that is over: figures, highlights, CSV, PDF, certificates."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from django.http import HttpResponse
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework import serializers, status
from rest_framework.exceptions import Throttled
from rest_framework.permissions import AllowAny, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import refuse_fields
from core.file_view import FileView
from paddock.errors import UserFault
from videos.responses import page_language
from videos.selectors import shown_video

from ..afterwards.again import require_ended
from ..afterwards.certificate import certificate, placed, require_settled
from ..afterwards.highlights import Highlight, ask_for_highlights, latest_reel, moments_of
from ..afterwards.results import event_csv, laps_csv, results_pdf
from ..afterwards.statistics import figures_of
from ..models import LiveEvent, Race
from ..views.common import too_many
from .live import live_event
from .lookup import visible_race
from .videos import VideoSerializer

# A page with Korean letters takes more than a second, and highlights read all traces.
RATES = {"paper": "20/m/key", "highlights": "20/m/key"}
A_MINUTE_S = 60


class FastestLapSerializer(serializers.Serializer):
    """The fastest complete lap."""

    racer = serializers.CharField()
    time_ms = serializers.IntegerField()
    lap = serializers.IntegerField(help_text="Its number in its run, from 1.")


class GainSerializer(serializers.Serializer):
    """Who came up farthest."""

    racer = serializers.CharField()
    before = serializers.IntegerField(help_text="Place in qualifying.")
    after = serializers.IntegerField(help_text="Place at the end.")


class RacerFiguresSerializer(serializers.Serializer):
    """One racer in figures."""

    racer = serializers.CharField()
    rank = serializers.IntegerField(allow_null=True)
    runs = serializers.IntegerField()
    laps = serializers.IntegerField(help_text="Complete ones.")
    best_lap_ms = serializers.IntegerField(allow_null=True)
    average_ms = serializers.IntegerField(allow_null=True, help_text="Of the complete laps.")
    speed_mps = serializers.FloatField(allow_null=True, help_text="Over the complete laps.")
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    resets = serializers.IntegerField()


class LiveFiguresSerializer(serializers.Serializer):
    """A live event in figures."""

    runs = serializers.IntegerField()
    without_result = serializers.IntegerField(help_text="Runs that ended without one.")
    laps = serializers.IntegerField(help_text="Complete ones.")
    distance_m = serializers.FloatField(help_text="Of the complete laps.")
    driven_ms = serializers.IntegerField(help_text="In all, penalties included.")
    average_mps = serializers.FloatField(allow_null=True, help_text="Speed over the complete laps.")
    fastest = FastestLapSerializer(allow_null=True)
    best_sectors = serializers.ListField(child=serializers.IntegerField(), help_text="Over all complete laps, in ms.")
    off_tracks = serializers.IntegerField()
    crashes = serializers.IntegerField()
    resets = serializers.IntegerField()
    lead_changes = serializers.IntegerField(allow_null=True, help_text="null for duels, where nobody leads by time.")
    gain = GainSerializer(allow_null=True, help_text="Who came up farthest from their place in qualifying.")
    closest_ms = serializers.IntegerField(allow_null=True, help_text="The smallest gap between two neighbours.")
    racers = RacerFiguresSerializer(many=True, help_text="In the order of the standings.")


class HighlightSerializer(serializers.Serializer):
    """A moment."""

    kind = serializers.CharField(help_text="crash, save, fastest or closest.")
    racer = serializers.CharField(source="run.alias")
    evaluation = serializers.CharField(source="run.evaluation.public_id", help_text="The public_id of its run.")
    car = serializers.IntegerField(source="run.number", help_text="The number of the car in that run.")
    start_ms = serializers.IntegerField(help_text="Of the run.")
    end_ms = serializers.IntegerField()
    caption = serializers.SerializerMethodField(help_text="In the language of the request.")

    def get_caption(self, moment: Highlight) -> str:
        return moment.words()


class HighlightsSerializer(serializers.Serializer):
    """The moments that the rules choose, and their video."""

    moments = HighlightSerializer(many=True, help_text="In the order in which the video shows them.")
    video = VideoSerializer(allow_null=True, help_text="The one in the language of the request, if somebody asked.")


class LiveFiguresView(APIView):
    """Figures."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_live_figures",
        summary="A live event that has ended in figures",
        description="Refused with `results_not_yet` before its end.",
        responses=LiveFiguresSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        event = live_event(request, slug)
        require_ended(event)
        return Response(LiveFiguresSerializer(figures_of(event)).data)


class LiveHighlightsView(APIView):
    """Highlights."""

    token_scope = RACE
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="read_live_highlights",
        summary="The highlights of a live event that has ended",
        description="Crashes, saves, the fastest lap and the closest finish, chosen by rule; and their video.",
        responses=HighlightsSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        event = live_event(request, slug)
        require_ended(event)
        _spare(request, "highlights")
        video = latest_reel(event, page_language())
        return Response(HighlightsSerializer({"moments": _moments(event), "video": video}).data)

    @extend_schema(
        operation_id="ask_for_live_highlights",
        summary="Ask for one video of the highlights of a live event",
        description=(
            "In the language of the request. Read it until its state is `ready`; asking again answers the same (200). "
            "Refused with `highlights_none` where there is no moment to show."
        ),
        request=None,
        responses={200: VideoSerializer, 202: VideoSerializer},
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        event = live_event(request, slug)
        refuse_fields(request)
        by, now = racer_of(request), timezone.now()
        asked = ask_for_highlights(event=event, by=by, language=page_language(), now=now)
        answer = VideoSerializer(shown_video(asked.video)).data
        return Response(answer, status=status.HTTP_202_ACCEPTED if asked.queued else status.HTTP_200_OK)


class _CsvView(FileView):
    permission_classes = [AllowAny]
    media_type = "text/csv"

    def written(
        self, request: Request, slug: str, name: str, lines: Callable[[LiveEvent], Iterable[str]]
    ) -> HttpResponse:
        event = live_event(request, slug)
        require_settled(event.race, timezone.now())
        return HttpResponse(
            "".join(lines(event)), content_type="text/csv; charset=utf-8", headers=_as_file(f"{slug}-{name}.csv")
        )


class LiveResultsView(_CsvView):
    """Results as CSV."""

    @extend_schema(
        operation_id="read_live_results",
        summary="How a live event ended, as CSV",
        responses={(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description="A line a racer.")},
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> HttpResponse:
        return self.written(request, slug, "results", event_csv)


class LiveLapsView(_CsvView):
    """Laps as CSV."""

    @extend_schema(
        operation_id="read_live_laps",
        summary="Every lap of a live event that has ended, as CSV",
        responses={(200, "text/csv"): OpenApiResponse(OpenApiTypes.STR, description="A line a lap.")},
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> HttpResponse:
        return self.written(request, slug, "laps", laps_csv)


class _PaperView(FileView):
    permission_classes = [AllowAny]
    media_type = "application/pdf"

    def written(self, request: Request, race: Race, name: str, make: Callable[[str], bytes]) -> HttpResponse:
        """``make``: the PDF, given the address of the race's page."""
        require_settled(race, timezone.now())
        _spare(request, "paper")
        address = request.build_absolute_uri(race.get_absolute_url())
        return HttpResponse(make(address), content_type="application/pdf", headers=_as_file(name))


class ResultsPdfView(_PaperView):
    """Results as PDF."""

    @extend_schema(
        operation_id="read_results_pdf",
        summary="The results of a race that is over, as PDF",
        description="Of its live event, with its figures, if it had one. In the language of the request.",
        responses={(200, "application/pdf"): OpenApiResponse(OpenApiTypes.BINARY, description="A4.")},
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> HttpResponse:
        race = visible_race(request, slug)
        now = timezone.now()
        return self.written(request, race, f"{slug}-results.pdf", lambda address: results_pdf(race, now, address))


class CertificateView(_PaperView):
    """A certificate."""

    @extend_schema(
        operation_id="read_certificate",
        summary="A racer's certificate, as PDF",
        description="Once the race is over. In the language of the request.",
        responses={(200, "application/pdf"): OpenApiResponse(OpenApiTypes.BINARY, description="A4, landscape.")},
        tags=["races"],
    )
    def get(self, request: Request, slug: str, alias: str) -> HttpResponse:
        race = visible_race(request, slug)
        entries = race.entries.select_related("race__organiser", "race__track", "racer")
        entry = get_object_or_404(entries, racer__alias__iexact=alias, is_baseline=False, withdrawn_at=None)
        now = timezone.now()

        def make(address: str) -> bytes:
            return certificate(placed(race, entry, now), address)

        return self.written(request, race, f"{slug}-{entry.racer.alias}.pdf", make)


def _moments(event: LiveEvent) -> list[Highlight]:
    try:
        return moments_of(event)
    except UserFault as fault:
        if fault.code == "highlights_none":
            return []
        raise


def _spare(request: Request, action: str) -> None:
    """Raises Throttled for who asks for too much of what takes long to make."""
    if too_many(request._request, action, RATES) is not None:
        raise Throttled(wait=A_MINUTE_S)


def _as_file(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
