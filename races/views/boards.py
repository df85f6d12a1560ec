"""A race's board for programs."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse, JsonResponse, StreamingHttpResponse
from django.utils import timezone
from django.views.decorators.http import require_safe

from races.exports import board_data, csv_lines
from races.selectors import whole_board

from .common import visible_race


@require_safe
def board_csv(request: HttpRequest, slug: str) -> HttpResponse:
    """The whole board as CSV."""
    race = visible_race(request, slug)
    response = StreamingHttpResponse(csv_lines(whole_board(race)), content_type="text/csv; charset=utf-8")
    response["Content-Disposition"] = f'attachment; filename="{race.slug}.csv"'
    return response


@require_safe
def board_json(request: HttpRequest, slug: str) -> HttpResponse:
    """The whole board as JSON."""
    return JsonResponse(board_data(visible_race(request, slug), timezone.now()), json_dumps_params={"indent": 1})
