"""The list of races and one race: board, rules, my runs."""

from urllib.parse import urlencode

from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse, QueryDict
from django.shortcuts import redirect, render
from django.template.loader import render_to_string
from django.utils import timezone
from django.views.decorators.http import require_safe

from accounts.models import Viewer
from accounts.request_racer import racer_of
from core.streams.shared_pieces import shared_piece
from races.boards.drawn_boards import drawn_board
from races.boards.ranking import order_rule, rule_for
from races.boards.selectors.board import as_seen_by, groups_on, podiums, team_board, to_beat
from races.boards.selectors.shared_boards import shared_race
from races.entries.selectors import lists
from races.models import RaceKind, RaceType
from races.rules.layout import box_marks
from races.spoilers.selectors import spoilers_of
from races.timing.selectors import beside

from ...runs.latest_run import latest_run
from ...web.race_page import race_context
from ...web.views import shown_race

CARDS_PER_PAGE = 12
ROWS_PER_PAGE = 50
LISTED = "races/pages/parts/listed.html"


@require_safe
def races(request: HttpRequest) -> HttpResponse:
    """Races by state (``show``), kind and type. Readers who see the same races share the list."""
    show, kind, race_type = (request.GET.get(name, "") for name in ("show", "kind", "type"))
    if show == "mine" and not request.user.is_authenticated:
        return redirect("account_login")
    show = show if show in lists.STATES or show == "mine" else "open"
    kind = kind if kind in RaceKind.values else ""
    race_type = race_type if race_type in RaceType.values else ""
    number = page_number(request)
    now, is_racer = timezone.now(), request.user.is_authenticated

    def values(viewer: Viewer = None) -> dict[str, object]:
        found = lists.races_of(racer_of(request)) if show == "mine" else lists.races_in(show, now, viewer)
        if kind:
            found = found.filter(kind=kind)
        if race_type:
            found = found.filter(race_type=race_type)
        page = Paginator(found, CARDS_PER_PAGE if show == "open" else ROWS_PER_PAGE).get_page(number)
        chosen = {"show": "" if show == "open" else show, "kind": kind, "type": race_type}
        query = QueryDict(urlencode({name: value for name, value in chosen.items() if value}))
        context = {"show": show, "kind": kind, "type": race_type, "types": RaceType.choices, "page": page}
        best = podiums(page.object_list) if show == "open" else {}
        return context | {"query": query, "is_racer": is_racer, "podiums": best, "to_beat": to_beat(best)}

    if show == "mine" or spoilers_of(request).on or not lists.sees_only_public(request.user, (show,), now):
        listed = render_to_string(LISTED, values(request.user), request)
    else:
        listed = shared_piece(LISTED, values, key=(show, kind, race_type, number, is_racer))
    return render(request, "races/pages/list.html", {"listed": listed})


@require_safe
def race(request: HttpRequest, slug: str) -> HttpResponse:
    """A race with its board; ``group``: among a group's members, ``by=teams``: of teams."""
    shown = shown_race(request, slug)
    number = page_number(request)
    groups = groups_on(shown, request.user)
    group = next((one for one in groups if one.slug == request.GET.get("group")), None)
    teams = team_board(shown) if shown.team_entries and request.GET.get("by") == "teams" else None
    drawn = drawn_board(slug, number, group)
    standings = as_seen_by(drawn.board, shown, request.user, pinned=group is None)
    context = race_context(request, shown, standings.my_entry, looked_up=True)
    context |= {
        "tab": "board",
        "board": standings,
        "drawn": drawn,
        "lines": drawn.lines.for_reader(request.user.pk),
        "cut": drawn.cut,
        "my_cut": drawn.cut_for(standings),
        "groups": groups,
        "teams": teams,
        "group": group,
    }
    if shown.physical:
        context["beside"] = beside(shown, [row.entry for row in standings.rows], request.user)
    return render(request, "races/pages/board.html", context)


@require_safe
def race_rules(request: HttpRequest, slug: str) -> HttpResponse:
    """What a race's rules are, in sentences and in figures."""
    shown = shown_race(request, slug)
    rules = shared_piece("races/pages/rules_text.html", lambda: _rules(slug), key=slug)
    context = race_context(request, shown) | {"tab": "rules", "rules": rules}
    return render(request, "races/pages/rules.html", context)


def _rules(slug: str) -> dict[str, object]:
    race = shared_race(slug)
    return {
        "race": race,
        "ranking_rule": rule_for(race).rule(race),
        "order_rule": order_rule(race),
        "boxes": box_marks(race),
    }


@login_required
@require_safe
def race_runs(request: HttpRequest, slug: str) -> HttpResponse:
    """Everything that I have sent to a race."""
    shown = shown_race(request, slug)
    context = race_context(request, shown)
    entry = context["entry"]
    context |= {"tab": "runs", "rows": lists.submissions_of(entry) if entry else []}
    return render(request, "races/pages/runs.html", context)


@login_required
@require_safe
def race_live(request: HttpRequest, slug: str) -> HttpResponse:
    """The reader's last submission as a fragment that polls until the run is done; 204 while ``seen`` is unchanged. The
    event ``paddock:raced`` reloads the board at the end."""
    shown = shown_race(request, slug)
    latest = latest_run(lists.entry_of(shown, request.user))
    if latest is not None and latest.mark == request.GET.get("seen"):
        return HttpResponse(status=204)
    response = render(request, "races/runs/latest_run.html", {"race": shown, "latest": latest})
    if latest is not None and latest.evaluation.is_final:
        response["HX-Trigger"] = "paddock:raced"
    response["Cache-Control"] = "private, no-store"
    return response


def page_number(request: HttpRequest) -> int:
    page = request.GET.get("page", "1")
    return int(page) if page.isdecimal() and len(page) < 9 else 1
