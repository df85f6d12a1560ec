"""Pages that plan a whole season from one form, with a preview."""

import json
from datetime import datetime

from django.contrib import messages
from django.contrib.admin.models import ADDITION
from django.contrib.auth.decorators import login_required
from django.core.exceptions import BadRequest, PermissionDenied, ValidationError
from django.http import HttpRequest, HttpResponse, QueryDict
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.dates import MONTHS
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.http import require_http_methods

from accounts.request_racer import racer_of
from league.seasons.forms.round_form import RoundForm, change_of, is_sent, write_changes
from league.seasons.forms.season_form import SeasonForm
from league.seasons.services.season_plan import (
    Previewed,
    RoundPlan,
    SeasonPlan,
    digest_of,
    preview_season,
    schedule_season,
)
from paddock.errors import UserFault
from races.rules.layout_form import preview as layout_of
from races.web.audit_log import log

_BUTTONS = ("csrfmiddlewaretoken", "do", "round", "season")


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def season_new(request: HttpRequest) -> HttpResponse:
    """Plan a season, preview it, change single races, and create it; for admins who may add seasons."""
    if not request.user.has_perm("league.add_season"):
        raise PermissionDenied
    if request.method != "POST":
        form = SeasonForm(now=timezone.now(), initial={"replaces": request.GET.get("replaces", "")[:50]})
        return render(request, "league/seasons/form.html", {"form": form})
    do, _colon, key = request.POST.get("do", "").partition(":")
    if "round" in request.POST:
        return _change(request, do)
    data = request.POST.copy()
    for name in _BUTTONS:
        data.pop(name, None)
    if do == "change":
        return _show_round(request, data, key)
    return _make(request, data) if do == "make" else _show_plan(request, data)


def _make(request: HttpRequest, data: QueryDict) -> HttpResponse:
    """Make the season, if it is the one that was looked at."""
    now = timezone.now()
    form = SeasonForm(data, now=now)
    if not form.is_valid():
        return _show_form(request, form)
    plan = form.plan(now)
    try:
        if form.cleaned_data["seen"] != digest_of(plan.rounds(now)):
            note = _("The season has changed since your preview. This is the new preview.")
            return _show_plan(request, data, note if form.cleaned_data["seen"] else "")
        season, count = schedule_season(plan=plan, now=now)
    except (UserFault, ValidationError):
        return _show_plan(request, data)
    log(racer_of(request), season, ADDITION, f"Made from the template with {count} races")
    text = ngettext("Season created: %d race.", "Season created: %d races.", count) % count
    messages.success(request, text)
    return redirect(season)


def _show_form(request: HttpRequest, form: SeasonForm) -> HttpResponse:
    """The form with its errors, and what is wrong with the races where the errors do not hide it."""
    repaired = form.repaired()
    if repaired is not None and repaired.is_valid():
        now = timezone.now()
        try:
            _add_problems(form, preview_season(plan=repaired.plan(now), now=now))
        except (UserFault, ValidationError) as refused:
            form.show(refused)
    return render(request, "league/seasons/form.html", {"form": form}, status=422 if form.errors else 200)


def _show_plan(request: HttpRequest, data: QueryDict, note: str = "") -> HttpResponse:
    """The form again, below all races as they would be and what is wrong with them."""
    now = timezone.now()
    form = SeasonForm(data, now=now)
    if not form.is_valid():
        return _show_form(request, form)
    try:
        shown = preview_season(plan=form.plan(now), now=now)
    except (UserFault, ValidationError) as refused:
        form.show(refused)
        return _show_form(request, form)
    data = data.copy()
    data["seen"] = digest_of([one.plan for one in shown])
    form = SeasonForm(data, now=now)
    form.is_valid()
    _add_problems(form, shown)
    changes = form.round_changes()
    context = {"form": form, "rounds": _by_month(shown), "count": len(shown), "changed": set(changes), "note": note}
    return render(request, "league/seasons/form.html", context, status=422 if form.errors else 200)


def _add_problems(form: SeasonForm, shown: list[Previewed]) -> None:
    for sentence in dict.fromkeys(problem for one in shown for problem in one.problems):
        form.add_error(None, sentence)


def _by_month(shown: list[Previewed]) -> list[tuple[str, list[Previewed]]]:
    months: dict[tuple[int, bool], list[Previewed]] = {}
    for one in shown:
        months.setdefault((one.plan.number, one.plan.key == "championship"), []).append(one)
    return [
        (_("Championship") if final else str(MONTHS[races[0].plan.month]), races)
        for (_number, final), races in months.items()
    ]


def _show_round(request: HttpRequest, data: QueryDict, key: str) -> HttpResponse:
    now = timezone.now()
    season = SeasonForm(data, now=now)
    if not season.is_valid():
        return _show_form(request, season)
    round_ = _find(season.plan(now), key, now)
    if round_ is None:
        return _show_plan(request, data)
    form = RoundForm(race=round_.unsaved(), now=now)
    return _render_round(request, data, round_, form, submitted=False)


def _change(request: HttpRequest, do: str) -> HttpResponse:
    """Store the changes of one race, or return it to the pattern."""
    now = timezone.now()
    key, data = request.POST["round"], _season_data(request.POST.get("season", ""))
    season = SeasonForm(data, now=now)
    if not season.is_valid():
        return _show_form(request, season)
    changes = season.round_changes()
    others = {name: change for name, change in changes.items() if name != key}
    pattern = _find(season.plan(now, others), key, now)
    if do == "keep" and pattern is not None:
        form = RoundForm(request.POST, race=pattern.unsaved(), now=now)
        if form.is_valid():
            for sentence in layout_of(form, submitted=True).problems:
                form.add_error(None, sentence)
        if form.errors:
            return _render_round(request, data, pattern, form, submitted=True)
        change = change_of(form, pattern)
        data["changes"] = write_changes(others | ({} if change is None else {key: change}))
    elif do == "pattern":
        data["changes"] = write_changes(others)
    return _show_plan(request, data)


def _render_round(
    request: HttpRequest, data: QueryDict, round_: RoundPlan, form: RoundForm, *, submitted: bool
) -> HttpResponse:
    context = {
        "form": form,
        "round": round_,
        "layout": layout_of(form, submitted=submitted),
        "season": json.dumps(dict(data.lists())),
    }
    return render(request, "league/seasons/round_form.html", context, status=422 if form.errors else 200)


def _find(plan: SeasonPlan, key: str, now: datetime) -> RoundPlan | None:
    """The race of a plan by its key; None for another key and for a plan without races."""
    try:
        return next((one for one in plan.rounds(now) if one.key == key), None)
    except UserFault:
        return None


def _season_data(text: str) -> QueryDict:
    """The season's form as it travelled with the form of a race. Raises BadRequest for what no page of ours sent."""
    try:
        sent = json.loads(text)
    except (ValueError, RecursionError):
        sent = None
    if not is_sent(sent):
        raise BadRequest("no season")
    data = QueryDict(mutable=True)
    for name, values in sent.items():
        data.setlist(name, values)
    return data
