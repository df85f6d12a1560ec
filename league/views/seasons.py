"""Seasons: what is on, standings, fields, calendar, rules, a racer's way through one; past seasons, hall of fame."""

from __future__ import annotations

import zoneinfo
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from accounts.regions import all_regions
from core.times import site_day
from league.calendars import season_calendar, zone_names
from league.drawing import ChartPoint, progress_chart
from league.exports import standings_csv, standings_data, standings_feed
from league.models import Round, Season, Stage
from league.models.season import WITH_FIELD
from league.selectors import hall_of_fame, months_of, racer_season, rules_of
from league.selectors.outcomes import stages_of
from league.selectors.overview import (
    RACERS,
    STAGE_OF,
    STANDINGS_OF,
    current_season,
    divisions_with_points,
    fields_in_time,
    fields_of,
    groups_raced,
    leaders_shown,
    month_races,
    running_rounds,
    seasons_listed,
    standings_table,
    standpoint_of,
)
from league.selectors.racers import racer_shown
from races.models import Division, Race, RaceState
from races.names import named
from races.ranking import RULES, order_rule

ROWS = 50
LEADERS = 5


@require_safe
def seasons(request: HttpRequest) -> HttpResponse:
    """All seasons, the running one first in sight."""
    now = timezone.now()
    listed = list(seasons_listed())
    context = {
        "seasons": listed,
        "today": site_day(now),
        "current": current_season(now),
    }
    return render(request, "league/seasons.html", context)


@require_safe
def season_now(request: HttpRequest) -> HttpResponse:
    """The season of today, under an address that stays."""
    season = current_season(timezone.now())
    return redirect("seasons") if season is None else redirect("season", season.slug)


@require_safe
def season(request: HttpRequest, slug: str) -> HttpResponse:
    """The months of a season, who leads, who has qualified."""
    shown, now = _season(slug), timezone.now()
    months = months_of(shown)
    races = month_races(months, now)
    context = _context(request, shown, "overview") | {
        "months": [(month, [races[one.pk] for one in month]) for month in months],
        "tables": leaders_shown(shown, LEADERS, months, now),
        "state": _state(shown, now),
        "official": sum(one.closed_at is not None for month in months for one in month),
        "race_count": len(races),
        "racing": [one for one in races.values() if one.state == RaceState.OPEN],
        "of_season": [one.race for one in races.values()],
        "follows": f"season:{shown.pk}",
        "successor": Season.objects.filter(follows=shown).first(),
        "imported": any(one.race.imported_at for one in races.values()),
    }
    return render(request, "league/season.html", context)


@require_safe
def standings(request: HttpRequest, slug: str) -> HttpResponse:
    """Standings by ``division`` of ``of`` (racers, countries, regions, teams) with every round, dropped results marked;
    with ``group`` or ``region`` racers of one among each other, with ``as=now``, and as long as no round is official,
    with the rounds that are on as they stand."""
    shown, now = _season(slug), timezone.now()
    months = months_of(shown)
    divisions = divisions_with_points(months) or [Division.OPEN]
    wanted = request.GET.get("division", "")
    division = Division(wanted) if wanted in divisions else divisions[0]
    of = request.GET.get("of", RACERS)
    of = of if of in STANDINGS_OF else RACERS
    running = running_rounds(months, division, now)
    rounds = [one for month in months for one in month if one.stage == STAGE_OF[division]]
    has_official = any(one.closed_at is not None for one in rounds)
    as_it_stands = bool(running) and (not has_official or request.GET.get("as") == "now")
    groups = groups_raced(shown, request.user)
    group = next((one for one in groups if one.slug == request.GET.get("group") and of == RACERS), None)
    regions = all_regions()
    region = next((one for one in regions if one == request.GET.get("region") and of == RACERS and not group), "")
    table = standings_table(shown, division, of, months, running if as_it_stands else (), group, region)
    mine = next((row for row in table.rows if row.racer is not None and row.racer.pk == request.user.pk), None)
    page = Paginator(table.rows, ROWS).get_page(request.GET.get("page"))
    context = _context(request, shown, "standings") | {
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
        "mine": mine if mine is not None and mine not in list(page.object_list) else None,
    }
    return render(request, "league/standings.html", context)


def _opens_next(rounds: Sequence[Round], now: datetime) -> Round | None:
    """The next of the rounds that opens; None after the last."""
    coming = [one for one in rounds if one.race.state_at(now) == RaceState.UPCOMING]
    return min(coming, key=lambda one: one.race.opens_at, default=None)


@require_safe
def standings_file(request: HttpRequest, slug: str, form: str) -> HttpResponse:
    """All standings of a season for programs: ``form`` json, csv or atom."""
    shown = _season(slug)
    rows = standings_data(shown, months_of(shown))
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
    shown = _season(slug)
    now = timezone.now()
    months, championship = fields_of(shown, months_of(shown), now)
    context = _context(request, shown, "fields") | {
        "fields": fields_in_time(months, now),
        "championship": championship,
    }
    return render(request, "league/fields.html", context)


@require_safe
def rules(request: HttpRequest, slug: str) -> HttpResponse:
    """The rules of a season in plain sentences, made from its settings."""
    shown = _season(slug)
    stages = list(shown.stage_rules.all())
    order = list(Stage)
    stages.sort(key=lambda one: order.index(Stage(one.stage)))
    context = _context(request, shown, "rules") | {
        "sentences": rules_of(shown),
        "stages": [(one, RULES[one.ranking_method].rule(one)) for one in stages],
        "order_rule": order_rule(Race()),
        "points": list(enumerate(shown.points, start=1)),
    }
    return render(request, "league/season_rules.html", context)


@require_safe
def calendar(request: HttpRequest, slug: str) -> HttpResponse:
    """Every race of a season in time, in a time zone that is named (``zone``)."""
    shown = _season(slug)
    name = request.GET.get("zone", "")
    known = zone_names()
    name = name if name in known else timezone.get_current_timezone_name()
    name = name if name in known else "UTC"  # such as "Etc/GMT-9", which is no place
    now = timezone.now()
    months = months_of(shown)
    races = sorted(
        (one for month in months for one in month), key=lambda one: (one.race.opens_at, one.race.closes_at, one.pk)
    )
    context = _context(request, shown, "calendar") | {
        "races": [(one, one.race.state_at(now)) for one in races],
        "zone": zoneinfo.ZoneInfo(name),
        "zone_name": name,
        "zones": known,
    }
    return render(request, "league/calendar.html", context)


@require_safe
def calendar_file(request: HttpRequest, slug: str) -> HttpResponse:
    """The calendar for calendar programs (iCalendar, RFC 5545)."""
    shown = _season(slug)
    text = season_calendar(shown, address=lambda path: request.build_absolute_uri(path))
    response = HttpResponse(text, content_type="text/calendar; charset=utf-8")
    response["Content-Disposition"] = f'inline; filename="{shown.slug}.ics"'
    return response


@require_safe
def season_racer(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """One racer's season: every round, what came of it, and how the ranks went."""
    shown = _season(slug)
    racer = racer_shown(alias)
    if racer is None:
        raise Http404
    if racer.alias != alias:
        return redirect("season_racer", shown.slug, racer.alias, permanent=True)
    rows = racer_season(shown, racer)
    points = [
        ChartPoint(row.rank, row.round.stage, str(row.round.number), f"{named(row.round.race.name)}: {row.rank}")
        for row in rows
        if row.rank is not None
    ]
    title = _("Ranks of %(racer)s in %(season)s") % {"racer": racer.alias, "season": shown.name}
    stages = dict.fromkeys(row.round.stage for row in rows if row.rank is not None)
    where = standpoint_of(shown, racer)
    dropped = {
        (division, result.round)
        for division, line in where.lines.items()
        for result in line.results
        if result.round in line.dropped
    }
    context = _context(request, shown, "racer") | {
        "racer": racer,
        "rows": rows,
        "where": where,
        "lines": [(Division(name), line) for name, line in where.lines.items()],
        "dropped_count": len(dropped),
        "chart": progress_chart(points, title=title) if points else "",
        "stages": [Stage(one) for one in stages],
    }
    return render(request, "league/season_racer.html", context)


@require_safe
def hall(request: HttpRequest) -> HttpResponse:
    """The winners of every season."""
    return render(
        request,
        "league/hall.html",
        {"halls": hall_of_fame(), "today": site_day(timezone.now())},
    )


def _season(slug: str) -> Season:
    return get_object_or_404(Season, slug=slug)


def _context(request: HttpRequest, season: Season, tab: str) -> dict[str, Any]:
    stages = stages_of(season) or set(Stage)
    return {
        "season": season,
        "tab": tab,
        "has_finales": bool(stages.intersection(WITH_FIELD)),
        "has_divisions": bool(stages - {Stage.SINGLE}),
        "can_edit": request.user.is_staff and request.user.has_perm("league.change_season"),
    }


def _state(season: Season, now: Any) -> RaceState:
    today = site_day(now)
    if today < season.starts_on:
        return RaceState.UPCOMING
    return RaceState.OPEN if today <= season.ends_on else RaceState.CLOSED
