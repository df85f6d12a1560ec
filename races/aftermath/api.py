"""Results of finished races and live events: figures, highlights, CSV, PDF and certificates."""

from collections.abc import Callable, Iterable

from django.http import HttpResponse
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiResponse
from rest_framework import serializers, status
from rest_framework.exceptions import Throttled
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.documents import serializer_of
from core.api.operations import csv_of, operation
from core.api.views import APIView, FileView
from paddock.errors import UserFault
from videos.responses import page_language
from videos.selectors import shown_video

from ..live.api import live_event
from ..live.statistics import LiveFigures, figures_of
from ..models import LiveEvent, Race
from ..runs.api.videos import VideoSerializer
from ..web.api import visible_race
from ..web.views import downloaded, too_many
from .certificate import certificate, entry_of_certificate, placed, require_settled
from .highlights import Highlight, ask_for_highlights, latest_reel, moments_of
from .results import event_csv, laps_csv, results_pdf
from .watch_again import require_ended

# A page with Korean letters takes more than a second, and highlights read all traces.
RATES = {"paper": "20/m", "highlights": "20/m"}
A_MINUTE_S = 60


def settled_event(request: Request, slug: str) -> LiveEvent:
    """A live event of a race that is over. Raises as :func:`live_event` and :func:`require_settled`."""
    event = live_event(request, slug)
    require_settled(event.race, timezone.now())
    return event


class HighlightSerializer(serializers.Serializer):
    """A moment."""

    kind = serializers.CharField(help_text="crash, save, fastest or closest.")
    racer = serializers.CharField(source="run.alias")
    evaluation = serializers.CharField(source="run.evaluation.public_id", help_text="The public_id of its run.")
    car = serializers.IntegerField(source="run.number", help_text="The number of the car in that run.")
    start_ms = serializers.IntegerField(help_text="Of the run.")
    end_ms = serializers.IntegerField()
    caption = serializers.CharField(source="words", read_only=True, help_text="In the language of the request.")


class HighlightsSerializer(serializers.Serializer):
    """The moments that the rules choose, and their video."""

    moments = HighlightSerializer(many=True, help_text="In the order in which the video shows them.")
    video = VideoSerializer(allow_null=True, help_text="The one in the language of the request, if somebody asked.")


class LiveFiguresView(APIView):
    @operation(
        "read_live_figures",
        "A live event that has ended in figures",
        find=live_event,
        answer=serializer_of(LiveFigures),
        description="Refused with `results_not_yet` before its end.",
    )
    def get(self, request: Request, event: LiveEvent) -> LiveFigures:
        require_ended(event)
        return figures_of(event)


class LiveHighlightsView(APIView):
    token_scope = RACE

    @operation(
        "read_live_highlights",
        "The highlights of a live event that has ended",
        find=live_event,
        answer=HighlightsSerializer,
        description="Crashes, saves, the fastest lap and the closest finish, chosen by rule; and their video.",
    )
    def get(self, request: Request, event: LiveEvent) -> dict[str, object]:
        require_ended(event)
        _spare(request, "highlights")
        return {"moments": _moments(event), "video": latest_reel(event, page_language())}

    @operation(
        "ask_for_live_highlights",
        "Ask for one video of the highlights of a live event",
        find=live_event,
        answer={200: VideoSerializer, 202: VideoSerializer},
        description=(
            "In the language of the request. Read it until its state is `ready`; asking again answers the same (200). "
            "Refused with `highlights_none` where there is no moment to show."
        ),
    )
    def post(self, request: Request, event: LiveEvent) -> Response:
        by, now = racer_of(request), timezone.now()
        asked = ask_for_highlights(event=event, by=by, language=page_language(), now=now)
        answer = VideoSerializer(shown_video(asked.video)).data
        return Response(answer, status=status.HTTP_202_ACCEPTED if asked.queued else status.HTTP_200_OK)


class _CsvView(FileView):
    media_type = "text/csv"

    def written(self, event: LiveEvent, name: str, lines: Iterable[str]) -> HttpResponse:
        return downloaded("".join(lines), f"{event.race.slug}-{name}.csv", "text/csv; charset=utf-8")


class LiveResultsView(_CsvView):
    @operation(
        "read_live_results", "Results of a live event, as CSV", find=settled_event, answer=csv_of("A line a racer.")
    )
    def get(self, request: Request, event: LiveEvent) -> HttpResponse:
        return self.written(event, "results", event_csv(event))


class LiveLapsView(_CsvView):
    @operation(
        "read_live_laps",
        "Every lap of a live event that has ended, as CSV",
        find=settled_event,
        answer=csv_of("A line a lap."),
    )
    def get(self, request: Request, event: LiveEvent) -> HttpResponse:
        return self.written(event, "laps", laps_csv(event))


class _PaperView(FileView):
    media_type = "application/pdf"

    def written(self, request: Request, race: Race, name: str, make: Callable[[str], bytes]) -> HttpResponse:
        """``make``: the PDF, given the address of the race's page."""
        require_settled(race, timezone.now())
        _spare(request, "paper")
        address = request.build_absolute_uri(race.get_absolute_url())
        return downloaded(make(address), name, "application/pdf")


class ResultsPdfView(_PaperView):
    @operation(
        "read_results_pdf",
        "The results of a race that is over, as PDF",
        find=visible_race,
        answer={(200, "application/pdf"): OpenApiResponse(OpenApiTypes.BINARY, description="A4.")},
        description="Of its live event, with its figures, if it had one. In the language of the request.",
    )
    def get(self, request: Request, race: Race) -> HttpResponse:
        return self.written(
            request, race, f"{race.slug}-results.pdf", lambda address: results_pdf(race, timezone.now(), address)
        )


class CertificateView(_PaperView):
    @operation(
        "read_certificate",
        "A racer's certificate, as PDF",
        answer={(200, "application/pdf"): OpenApiResponse(OpenApiTypes.BINARY, description="A4, landscape.")},
        description="Once the race is over. In the language of the request.",
    )
    def get(self, request: Request, slug: str, alias: str) -> HttpResponse:
        race = visible_race(request, slug)
        entry = entry_of_certificate(race, alias)
        return self.written(
            request,
            race,
            f"{slug}-{entry.racer.alias}.pdf",
            lambda address: certificate(placed(race, entry, timezone.now()), address),
        )


def _moments(event: LiveEvent) -> list[Highlight]:
    try:
        return moments_of(event)
    except UserFault as fault:
        if fault.code == "highlights_none":
            return []
        raise


def _spare(request: Request, action: str) -> None:
    """Limit the rate of costly downloads. Raises Throttled."""
    if too_many(request._request, action, RATES) is not None:
        raise Throttled(wait=A_MINUTE_S)
