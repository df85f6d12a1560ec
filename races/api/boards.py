"""The board of a race."""

from __future__ import annotations

from typing import Any

from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.utils.urls import replace_query_param
from rest_framework.views import APIView

from core.bodies import read_as

from ..exports import row_data
from ..models import RankingMethod
from ..selectors import PER_PAGE, Board, BoardRow, shared_board
from .lookup import visible_race

MAX_PER_PAGE = 100


class RowSerializer(serializers.Serializer):
    """One line of a board, with the same keys as the page's JSON and some more. Times in milliseconds."""

    rank = serializers.IntegerField(allow_null=True, help_text="null for house cars and for who is not classified.")
    racer = serializers.CharField()
    country = serializers.CharField(allow_blank=True)
    baseline = serializers.BooleanField(help_text="A house car, outside the ranking.")
    classified = serializers.BooleanField()
    score_ms = serializers.IntegerField(allow_null=True, help_text="What the race ranks by, until duels are drawn.")
    gap_ms = serializers.IntegerField(allow_null=True, help_text="To the leader.")
    average_ms = serializers.IntegerField(allow_null=True)
    best_lap_ms = serializers.IntegerField(allow_null=True)
    total_ms = serializers.IntegerField(allow_null=True)
    complete_laps = serializers.IntegerField()
    sector_1_ms = serializers.IntegerField(allow_null=True, help_text="Of the best lap.")
    sector_2_ms = serializers.IntegerField(allow_null=True)
    sector_3_ms = serializers.IntegerField(allow_null=True)
    off_tracks = serializers.IntegerField()
    resets = serializers.IntegerField()
    submissions = serializers.IntegerField()
    submitted_at = serializers.DateTimeField(allow_null=True)
    seed = serializers.IntegerField(
        allow_null=True, help_text="In a race of duels once drawn; what stands above is then the qualifying."
    )
    points = serializers.IntegerField(allow_null=True)
    duels = serializers.IntegerField(allow_null=True, help_text="Heats decided.")
    duel_lap_ms = serializers.IntegerField(allow_null=True, help_text="Average of all complete laps in duels.")
    guest = serializers.BooleanField(help_text="A racer without an account; `racer` is the name that was typed.")
    sector_colours = serializers.ListField(
        child=serializers.ChoiceField(["purple", "green", "yellow"], allow_null=True),
        help_text="purple: nobody was faster; green: the racer's own best; yellow: neither.",
    )
    has_fastest_lap = serializers.BooleanField(help_text="Nobody ranked has driven a faster lap.")
    is_me = serializers.BooleanField()
    evaluation = serializers.CharField(allow_null=True, help_text="The public_id of the run that stands here.")
    car_of = serializers.CharField(
        allow_null=True, help_text="Who sent this row's only car before: it has no place of its own. Else null."
    )

    def to_representation(self, row: BoardRow) -> dict[str, Any]:
        best = row.entry.best
        return super().to_representation(
            {
                **row_data(row),
                "sector_colours": row.sector_colours,
                "has_fastest_lap": row.has_fastest_lap,
                "is_me": row.is_me,
                "car_of": None if row.entry.car_of is None else row.entry.car_of.racer.alias,
                "evaluation": None if best is None else best.evaluation.public_id,
            }
        )


class BoardSerializer(serializers.Serializer):
    """One page of a board."""

    race = serializers.CharField(source="race.slug")
    ranking_method = serializers.ChoiceField(RankingMethod.choices, source="race.ranking_method")
    count = serializers.IntegerField(help_text="Racers on the whole board; house cars come on top.")
    classified_count = serializers.IntegerField()
    leader_ms = serializers.IntegerField(allow_null=True)
    page = serializers.IntegerField()
    pages = serializers.IntegerField()
    next = serializers.SerializerMethodField()
    previous = serializers.SerializerMethodField()
    my_row = RowSerializer(allow_null=True, help_text="Yours, on whichever page it stands.")
    results = RowSerializer(source="rows", many=True)

    def get_next(self, page: Board) -> str | None:
        return self._address(page.page + 1) if page.page < page.pages else None

    def get_previous(self, page: Board) -> str | None:
        return self._address(page.page - 1) if page.page > 1 else None

    def _address(self, number: int) -> str:
        return replace_query_param(self.context["request"].build_absolute_uri(), "page", number)


class PageSerializer(serializers.Serializer):
    """Which page."""

    page = serializers.IntegerField(min_value=1, default=1, help_text="The last one if there are not so many.")
    page_size = serializers.IntegerField(min_value=1, max_value=MAX_PER_PAGE, default=PER_PAGE)


class BoardView(APIView):
    """The board of a race."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_board",
        summary="The board",
        description="Racers in order, and house cars between them where their times would stand.",
        parameters=[PageSerializer],
        responses=BoardSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        asked = read_as(PageSerializer, request.query_params)
        page, page_size = asked["page"], asked["page_size"]
        shown = shared_board(visible_race(request, slug), request.user, page=page, per_page=page_size)
        return Response(BoardSerializer(shown, context={"request": request}).data)
