"""Pages of a season's standings and of the fields of its finales."""

from collections.abc import Sequence
from datetime import datetime

from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse, JsonResponse, QueryDict
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from accounts.models import RacerGroup
from accounts.profile.regions import all_regions
from core.streams.shared_pieces import marked_piece, shared_value
from league.models import Round, Season, Stage
from league.models.season import WITH_FIELD
from league.standings.exports import standings_csv, standings_data, standings_feed
from league.standings.selectors import tables
from league.standings.selectors.finale_fields import fields_in_time, fields_of
from league.standings.selectors.months import shared_months, shared_season
from league.standings.selectors.outcomes import stages_of
from league.standings.selectors.standings import RACERS, STANDINGS_OF
from races.models import Division, RaceState

ROWS = 50


@require_safe
def standings(request: HttpRequest, slug: str) -> HttpResponse:
    """Standings by ``division`` of ``of`` with every round; among a ``group`` or ``region``; with open rounds
    (``as=now``)."""
    shown, months, now = shared_season(slug), shared_months(slug), timezone.now()
    divisions = tables.divisions_with_points(months) or [Division.OPEN]
    wanted = request.GET.get("division", "")
    division = Division(wanted) if wanted in divisions else divisions[0]
    of = request.GET.get("of", RACERS)
    of = of if of in STANDINGS_OF else RACERS
    running = tables.running_rounds(months, division, now)
    rounds = tables.rounds_with_points(months, division)
    has_official = any(one.closed_at is not None for one in rounds)
    as_it_stands = bool(running) and (not has_official or request.GET.get("as") == "now")
    groups = tables.groups_raced(shown, request.user)
    group = next((one for one in groups if one.slug == request.GET.get("group") and of == RACERS), None)
    regions = all_regions()
    region = next((one for one in regions if one == request.GET.get("region") and of == RACERS and not group), "")

    def read() -> tables.StandingsTable:
        return _shared_table(slug, division, of, as_it_stands, group, region)

    table = read()
    mine = next((row for row in table.rows if row.racer is not None and row.racer.pk == request.user.pk), None)
    page = Paginator(table.rows, ROWS).get_page(request.GET.get("page"))

    def rows() -> dict[str, object]:
        newest = read()
        shown_rows = Paginator(newest.rows, ROWS).get_page(page.number)
        query = QueryDict(f"division={division}" if len(divisions) > 1 else "")
        return {"season": shared_season(slug), "of": of, "table": newest, "page": shown_rows, "query": query}

    key = (slug, division, of, as_it_stands, group and group.pk, region, page.number)
    context = season_context(request, shown, "standings") | {
        "division": division,
        "divisions": divisions,
        "of": of,
        "groups": groups if of == RACERS else [],
        "group": group,
        "region": region,
        "regions": regions,
        "table": table,
        "running": running,
        "has_official": has_official,
        "opens_next": _opens_next(rounds, now),
        "page": page,
        "rows": marked_piece("league/standings/parts/rows.html", rows, key=key, reader=request.user.pk),
        "mine": mine if mine is not None and mine not in list(page.object_list) else None,
    }
    return render(request, "league/standings/standings.html", context)


@require_safe
def standings_file(request: HttpRequest, slug: str, form: str) -> HttpResponse:
    """All standings of a season for programs: ``form`` json, csv or atom."""
    shown = shared_season(slug)
    rows = standings_data(shown, shared_months(slug))
    if form == "csv":
        response = HttpResponse(standings_csv(rows), content_type="text/csv; charset=utf-8")
        response["Content-Disposition"] = f'attachment; filename="{shown.slug}-standings.csv"'
        return response
    if form == "atom":
        feed = standings_feed(shown, rows, address=request.build_absolute_uri)
        return HttpResponse(feed.writeString("utf-8"), content_type=feed.content_type)
    data = {"season": shown.slug, "name": shown.name, "drop_worst": shown.drop_worst, "standings": rows}
    return JsonResponse(data, json_dumps_params={"indent": 1})


@require_safe
def fields(request: HttpRequest, slug: str) -> HttpResponse:
    """Finales and championship: whose the fields are, official or as they stand."""

    def values() -> dict[str, object]:
        now = timezone.now()
        months, championship = fields_of(shared_season(slug), shared_months(slug), now)
        return {"fields": fields_in_time(months, now), "championship": championship}

    piece = marked_piece("league/standings/parts/fields.html", values, key=slug, reader=request.user.pk)
    context = season_context(request, shared_season(slug), "fields") | {"shown": piece}
    return render(request, "league/standings/fields.html", context)


def season_context(request: HttpRequest, season: Season, tab: str) -> dict[str, object]:
    return {
        "season": season,
        "tab": tab,
        "has_finales": bool(_stages(season).intersection(WITH_FIELD)),
        "has_divisions": has_divisions(season),
        "can_edit": request.user.is_staff and request.user.has_perm("league.change_season"),
    }


def has_divisions(season: Season) -> bool:
    return bool(_stages(season) - {Stage.SINGLE})


def _stages(season: Season) -> set[str]:
    """The stages of a season; before its first round all."""
    return shared_value(("stages", season.pk), lambda: stages_of(season)) or set(Stage)


def _opens_next(rounds: Sequence[Round], now: datetime) -> Round | None:
    """The next of the rounds that opens; None after the last."""
    coming = [one for one in rounds if one.race.state_at(now) == RaceState.UPCOMING]
    return min(coming, key=lambda one: one.race.opens_at, default=None)


def _shared_table(
    slug: str, division: str, of: str, as_it_stands: bool, group: RacerGroup | None, region: str
) -> tables.StandingsTable:
    """The standings of everybody, or of a ``group`` that the reader may see, at most a second old."""

    def read() -> tables.StandingsTable:
        months = shared_months(slug)
        running = tables.running_rounds(months, division, timezone.now()) if as_it_stands else ()
        return tables.standings_table(shared_season(slug), division, of, months, running, group, region)

    return shared_value(("standings", slug, division, of, as_it_stands, group and group.pk, region), read)
