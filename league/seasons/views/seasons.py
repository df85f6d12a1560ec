"""Pages of seasons: list, overview, rules, calendar, a racer's season, hall of fame."""

import zoneinfo
from typing import Any

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.views.decorators.http import require_safe

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.streams.shared_pieces import marked_piece, shared_piece, shared_value
from core.times import site_day
from league.models import Season, Stage
from league.racers.selectors import racer_shown
from league.seasons import selectors
from league.seasons.calendars import season_calendar, zone_names
from league.seasons.progress_chart import ChartPoint, progress_chart
from league.standings.selectors.months import shared_months, shared_season
from league.standings.selectors.outcomes import rules_of
from league.standings.selectors.tables import leaders_shown, season_ratings
from league.standings.views import has_divisions, season_context
from races.boards.ranking import RULES, order_rule
from races.models import Division, Race, RaceState
from races.web.names import named

LEADERS = 5


@require_safe
def seasons(request: HttpRequest) -> HttpResponse:
    def values() -> dict[str, object]:
        return {"seasons": list(selectors.seasons_listed()), "today": site_day(timezone.now())}

    listed = shared_piece("league/seasons/parts/season_rows.html", values, key=())
    return render(request, "league/seasons/list.html", {"listed": listed})


@require_safe
def season_now(request: HttpRequest) -> HttpResponse:
    """The season of today, under an address that stays."""
    season = selectors.current_season(timezone.now())
    return redirect("seasons") if season is None else redirect("season", season.slug)


@require_safe
def season(request: HttpRequest, slug: str) -> HttpResponse:
    """The months of a season, its leaders and qualified racers."""

    def piece(name: str) -> SafeString:
        template = f"league/seasons/parts/{name}.html"
        return marked_piece(template, lambda: _overview(slug), key=slug, reader=request.user.pk)

    shown = shared_season(slug)
    context = season_context(request, shown, "overview") | _overview(slug)
    context |= {"follows": f"season:{shown.pk}", "rounds": piece("rounds"), "leaders": piece("leaders")}
    return render(request, "league/seasons/season.html", context)


def _overview(slug: str) -> dict[str, object]:
    def read() -> dict[str, object]:
        shown, months, now = shared_season(slug), shared_months(slug), timezone.now()
        races = selectors.month_races(months, now)
        return {
            "season": shown,
            "has_divisions": has_divisions(shown),
            "months": [(month, [races[one.pk] for one in month]) for month in months],
            "tables": leaders_shown(shown, LEADERS, months, now),
            "ratings": season_ratings(shown),
            "state": _state(shown, now),
            "official": sum(one.closed_at is not None for month in months for one in month),
            "race_count": len(races),
            "racing": [one for one in races.values() if one.state == RaceState.OPEN],
            "of_season": [one.race for one in races.values()],
            "successor": Season.objects.filter(follows=shown).first(),
            "imported": any(one.race.imported_at for one in races.values()),
        }

    return shared_value(("season overview", slug), read)


@require_safe
def rules(request: HttpRequest, slug: str) -> HttpResponse:
    """The rules of a season in plain sentences, made from its settings."""

    def values() -> dict[str, object]:
        shown, order = shared_season(slug), list(Stage)
        stages = sorted(shown.stage_rules.all(), key=lambda one: order.index(Stage(one.stage)))
        return {
            "season": shown,
            "sentences": rules_of(shown),
            "stages": [(one, RULES[one.ranking_method].rule(one)) for one in stages],
            "order_rule": order_rule(Race()),
            "points": list(enumerate(shown.points, start=1)),
        }

    context = season_context(request, shared_season(slug), "rules")
    context["shown"] = shared_piece("league/seasons/parts/rules_text.html", values, key=slug)
    return render(request, "league/seasons/rules.html", context)


@require_safe
def calendar(request: HttpRequest, slug: str) -> HttpResponse:
    """Every race of a season in time, in a time zone that is named (``zone``)."""
    known = zone_names()
    name = request.GET.get("zone", "")
    name = name if name in known else timezone.get_current_timezone_name()
    name = name if name in known else "UTC"  # such as "Etc/GMT-9", which is no place

    def values() -> dict[str, object]:
        rounds = [one for month in shared_months(slug) for one in month]
        rounds.sort(key=lambda one: (one.race.opens_at, one.race.closes_at, one.pk))
        now = timezone.now()
        return {
            "season": shared_season(slug),
            "races": [(one, one.race.state_at(now)) for one in rounds],
            "zone": zoneinfo.ZoneInfo(name),
            "zone_name": name,
            "zones": known,
        }

    context = season_context(request, shared_season(slug), "calendar")
    context["shown"] = shared_piece("league/seasons/parts/race_times.html", values, key=(slug, name))
    return render(request, "league/seasons/calendar.html", context)


@require_safe
def calendar_file(request: HttpRequest, slug: str) -> HttpResponse:
    shown = shared_season(slug)
    text = season_calendar(shown, address=lambda path: request.build_absolute_uri(path))
    response = HttpResponse(text, content_type="text/calendar; charset=utf-8")
    response["Content-Disposition"] = f'inline; filename="{shown.slug}.ics"'
    return response


@require_safe
def season_racer(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """One racer's season: every round, what came of it, and how the ranks went."""
    shown = shared_season(slug)
    is_mine = isinstance(request.user, Racer) and request.user.alias == alias and request.user.has_page
    racer = racer_of(request) if is_mine else racer_shown(alias)
    if racer is None:
        raise Http404
    if racer.alias != alias:
        return redirect("season_racer", shown.slug, racer.alias, permanent=True)
    context = season_context(request, shown, "racer") | {"racer": racer}
    template = "league/seasons/parts/racer_rounds.html"
    context["shown"] = shared_piece(template, lambda: _rounds_of(slug, racer.pk), key=(slug, racer.pk))
    return render(request, "league/seasons/racer.html", context)


def _rounds_of(slug: str, pk: int) -> dict[str, object]:
    shown, racer = shared_season(slug), Racer.objects.get(pk=pk)
    rows = selectors.racer_season(shown, racer)
    points = [
        ChartPoint(row.rank, row.round.stage, str(row.round.number), f"{named(row.round.race.name)}: {row.rank}")
        for row in rows
        if row.rank is not None
    ]
    title = _("Ranks of %(racer)s in %(season)s") % {"racer": racer.alias, "season": shown.name}
    stages = dict.fromkeys(row.round.stage for row in rows if row.rank is not None)
    where = selectors.standpoint_of(shown, racer)
    dropped = {
        (division, result.round)
        for division, line in where.lines.items()
        for result in line.results
        if result.round in line.dropped
    }
    return {
        "season": shown,
        "has_divisions": has_divisions(shown),
        "racer": racer,
        "rows": rows,
        "where": where,
        "lines": [(Division(name), line) for name, line in where.lines.items()],
        "dropped_count": len(dropped),
        "chart": progress_chart(points, title=title) if points else "",
        "stages": [Stage(one) for one in stages],
    }


@require_safe
def hall(request: HttpRequest) -> HttpResponse:
    def values() -> dict[str, object]:
        return {"halls": selectors.hall_of_fame(), "today": site_day(timezone.now())}

    winners = shared_piece("league/seasons/parts/winners.html", values, key=())
    return render(request, "league/seasons/hall_of_fame.html", {"winners": winners})


def _state(season: Season, now: Any) -> RaceState:
    today = site_day(now)
    if today < season.starts_on:
        return RaceState.UPCOMING
    return RaceState.OPEN if today <= season.ends_on else RaceState.CLOSED
