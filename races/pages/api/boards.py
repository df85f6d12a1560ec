"""The board of a race."""

from rest_framework import serializers
from rest_framework.request import Request
from rest_framework.utils.urls import replace_query_param

from core.api.documents import serializer_of
from core.api.fields import ChoiceField
from core.api.operations import operation
from core.api.views import APIView

from ...boards.exports import ExportedRow, row_data
from ...boards.selectors.board import PER_PAGE, Board, BoardRow
from ...boards.selectors.shared_boards import shared_board
from ...models import Race
from ...models.choices import ranking_choices
from ...web.api import visible_race

MAX_PER_PAGE = 100


class RowSerializer(serializer_of(ExportedRow)):  # type: ignore[misc]
    """One line of a board, with the same keys as the page's JSON and some more. Times in milliseconds."""

    submitted_at = serializers.DateTimeField(allow_null=True)
    sector_colours = serializers.ListField(
        child=serializers.ChoiceField(["purple", "green", "yellow"], allow_null=True),
        help_text="purple: nobody was faster; green: the racer's own best; yellow: neither.",
    )
    has_fastest_lap = serializers.BooleanField(help_text="Nobody ranked has driven a faster lap.")
    is_me = serializers.BooleanField()
    evaluation = serializers.CharField(allow_null=True, help_text="The public_id of the run that stands here.")
    car_of = serializers.CharField(
        allow_null=True, help_text="The racer who sent the same car first; such a row has no place. Else null."
    )

    def to_representation(self, row: BoardRow) -> dict[str, object]:
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
    ranking_method = ChoiceField(ranking_choices, source="race.ranking_method")
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
    @operation(
        "read_board",
        "The board",
        find=visible_race,
        query=PageSerializer,
        answer=BoardSerializer,
        description="Racers in order, and house cars between them where their times would stand.",
    )
    def get(self, request: Request, race: Race, asked: dict[str, int]) -> Board:
        return shared_board(race, request.user, page=asked["page"], per_page=asked["page_size"])
