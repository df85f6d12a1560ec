"""The list of races and one race: board, rules, my runs."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.db.models import Exists, OuterRef, QuerySet, Value
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from accounts.who import racer_of
from core.forms import explain
from evaluation.selectors import models_of
from races.afterwards.certificate import is_settled
from races.eligibility import refusal
from races.layout import box_marks
from races.models import Entry, Race, RaceKind, RaceState, RaceType
from races.ranking import order_rule, rule_for
from races.selectors import (
    can_organise,
    cancelled_races,
    closed_races,
    entry_of,
    podiums,
    races_of,
    racing_now,
    score_column,
    shared_board,
    submissions_of,
    to_beat,
    upcoming,
)
from races.selectors.group_boards import group_board, groups_on
from races.selectors.team_boards import team_board
from races.selectors.terms import has_accepted
from races.selectors.timing import beside, can_keep_time
from races.sensors import not_offered
from races.spoilers import spoilers_of

from .common import visible_race
from .latest import LatestRun, latest_run

CARDS_PER_PAGE = 12
ROWS_PER_PAGE = 50
SHOWS = ("open", "upcoming", "closed", "cancelled", "mine")


@require_safe
def races(request: HttpRequest) -> HttpResponse:
    """Races by state (``show``) and kind."""
    show = request.GET.get("show", "open")
    if show not in SHOWS:
        show = "open"
    if show == "mine" and not request.user.is_authenticated:
        return redirect("account_login")
    kind, race_type = request.GET.get("kind", ""), request.GET.get("type", "")
    found = _listed(request, show)
    if kind in RaceKind.values:
        found = found.filter(kind=kind)
    race_type = race_type if race_type in RaceType.values else ""
    if race_type:
        found = found.filter(race_type=race_type)
    per_page = CARDS_PER_PAGE if show == "open" else ROWS_PER_PAGE
    page = Paginator(found, per_page).get_page(request.GET.get("page"))
    context: dict[str, Any] = {
        "show": show,
        "kind": kind,
        "type": race_type,
        "types": RaceType.choices,
        "page": page,
        "now": timezone.now(),
    }
    if show == "open":
        context["podiums"] = podiums(page.object_list)
        context["to_beat"] = to_beat(context["podiums"])
    return render(request, "races/races.html", context)


def _listed(request: HttpRequest, show: str) -> QuerySet[Race]:
    now = timezone.now()
    if show == "mine":
        return races_of(racer_of(request))
    if show == "cancelled":
        return cancelled_races(request.user)
    lists = {"open": racing_now, "upcoming": upcoming, "closed": closed_races}
    return lists[show](now, request.user)


@require_safe
def race(request: HttpRequest, slug: str) -> HttpResponse:
    """A race with its board; with ``group`` that of a group's members among each other, with
    ``by=teams`` that of teams."""
    shown = visible_race(request, slug)
    page = request.GET.get("page", "1")
    number = int(page) if page.isdecimal() and len(page) < 9 else 1
    groups = groups_on(shown, request.user)
    group = next((one for one in groups if one.slug == request.GET.get("group")), None)
    teams = team_board(shown) if shown.team_entries and request.GET.get("by") == "teams" else None
    if group is None:
        standings = shared_board(shown, request.user, page=number)
    else:
        standings = group_board(shown, group, request.user, page=number)
    context = race_context(request, shown, standings.my_entry, looked_up=True)
    context |= {
        "tab": "board",
        "board": standings,
        "score_column": score_column(shown),
        "groups": groups,
        "teams": teams,
        "group": group,
    }
    if shown.physical:
        context["beside"] = beside(shown, [row.entry for row in standings.rows], request.user)
    return render(request, "races/race.html", context)


@require_safe
def race_rules(request: HttpRequest, slug: str) -> HttpResponse:
    """What a race's rules are, in sentences and in figures."""
    shown = visible_race(request, slug)
    context = race_context(request, shown)
    context |= {"tab": "rules", "order_rule": order_rule(shown), "boxes": box_marks(shown)}
    return render(request, "races/rules.html", context)


@login_required
@require_safe
def race_runs(request: HttpRequest, slug: str) -> HttpResponse:
    """Everything that I have sent to a race."""
    shown = visible_race(request, slug)
    context = race_context(request, shown)
    entry = context["entry"]
    context |= {"tab": "runs", "rows": submissions_of(entry) if entry else []}
    return render(request, "races/runs.html", context)


@login_required
@require_safe
def race_live(request: HttpRequest, slug: str) -> HttpResponse:
    """How my last car in this race is doing: a fragment that asks for itself again until the car is done.

    ``seen`` is what the reader has on screen; unchanged, the answer is empty (204). When the car has just finished,
    the page is told (``paddock:raced``), so that the board comes anew.
    """
    shown = visible_race(request, slug)
    latest = latest_run(entry_of(shown, request.user))
    if latest is not None and latest.mark == request.GET.get("seen"):
        return HttpResponse(status=204)
    response = render(request, "races/parts/live.html", {"race": shown, "latest": latest})
    if latest is not None and latest.evaluation.is_final:
        response["HX-Trigger"] = "paddock:raced"
    response["Cache-Control"] = "private, no-store"
    return response


def race_context(request: HttpRequest, shown: Race, entry: Entry | None = None, *, looked_up: bool = False) -> dict:
    """What the head of a race's pages and its box for sending a car need.

    ``entry``: the reader's, also None, where it was ``looked_up`` already.
    """
    now = timezone.now()
    state = shown.state_at(now)
    entry = entry if looked_up else entry_of(shown, request.user)
    hides = spoilers_of(request).hides(shown)
    latest: LatestRun | None = None if hides else latest_run(entry, queue=False)
    limit = shown.max_submissions
    left = None if limit is None else limit - (entry.submission_count if entry else 0)
    context = {
        "race": shown,
        "state": state,
        "entry": entry,
        "latest": latest,
        "ranking_rule": rule_for(shown).rule(shown),
        "can_organise": can_organise(request.user, shown),
        "can_keep_time": can_keep_time(request.user, shown),
        "has_results": not hides and is_settled(shown, now),
        "hides": hides,
        "left": left,
        "used_up": left is not None and left <= 0,
    }
    if request.user.is_authenticated and state in (RaceState.OPEN, RaceState.UPCOMING):
        context["asks_terms"] = not has_accepted(entry, shown)
        fault = refusal(shown, request.user, now)
        context["not_for_me"] = fault and explain(fault)
    if shown.physical and entry is not None:
        context["models"] = list(models_of(entry.racer))
    elif state == RaceState.OPEN and request.user.is_authenticated and not shown.physical:
        garage = list(models_of(request.user).annotate(is_sent=_is_sent(entry)))
        fitting = [model for model in garage if not not_offered(model.sensors, shown.sensors)]
        context |= {
            "models": [model for model in fitting if not model.is_sent],
            "all_sent": bool(fitting),
            "garage_is_empty": not garage,
        }
    return context


def _is_sent(entry: Entry | None) -> Exists | Value:
    """Whether an entry has sent a model's network: the same car would only drive the same laps again."""
    if entry is None:
        return Value(False)
    return Exists(entry.submissions.filter(is_void=False, network_id=OuterRef("network_id")).order_by())
