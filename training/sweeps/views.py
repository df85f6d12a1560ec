"""The pages of sweeps."""

from collections.abc import Sequence
from html import escape
from itertools import accumulate

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.request_racer import racer_of
from core.forms import explain
from core.pages.charts import Chart
from paddock.errors import UserFault

from ..models import Sweep
from .halving import plan
from .selectors import (
    TrialRow,
    can_delete_sweep,
    can_stop_sweep,
    dimension_label,
    importances,
    rows_of,
    score_of,
    value_words,
    visible_sweeps,
)
from .services import delete_sweep, stop_sweep
from .space import dimensions


@login_required
@require_safe
def sweep(request: HttpRequest, public_id: str) -> HttpResponse:
    found = visible_sweep(request, public_id)
    rows = rows_of(found)
    varied = list(dimensions(found.space))
    context = {
        "sweep": found,
        "base": rows[0].trial.job if rows else None,
        "dimensions": [dimension_label(name) for name in varied],
        "rows": [(row, [value_words(found, row.trial.setting, name) for name in varied]) for row in rows],
        "plan": plan(found.settings_count, found.budget_s),
        "chart": progress_chart(rows),
        "importances": importances(found, rows),
        "used_s": sum(row.trial.job.seconds_done for row in rows),
        "model": found.best.job.best_model if found.best is not None else None,
        "can_stop": can_stop_sweep(request.user, found),
        "can_delete": can_delete_sweep(request.user, found),
        "is_mine": request.user.pk == found.owner_id,
    }
    response = render(request, "training/sweeps/sweep.html", context)
    if not found.is_final:
        response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_POST
def sweep_stop(request: HttpRequest, public_id: str) -> HttpResponse:
    found = visible_sweep(request, public_id)
    if not found.is_final:
        if not can_stop_sweep(request.user, found):
            raise Http404
        stop_sweep(sweep=found, by=racer_of(request), now=timezone.now())
        messages.success(request, _("Stopping. The best setting so far becomes a model."))
    return redirect(found)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def sweep_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    found = visible_sweep(request, public_id)
    if not can_delete_sweep(request.user, found):
        raise Http404
    problem = None
    if request.method == "POST":
        try:
            delete_sweep(sweep=found, now=timezone.now())
        except UserFault as fault:
            problem = explain(fault)
        else:
            messages.success(request, _("Sweep deleted. Its models stay."))
            return redirect("trainings")
    context = {"sweep": found, "problem": problem}
    return render(request, "training/sweeps/delete.html", context, status=409 if problem else 200)


def visible_sweep(request: HttpRequest, public_id: str) -> Sweep:
    sweeps = visible_sweeps(request.user).select_related("owner", "best__job__best_model")
    return get_object_or_404(sweeps, public_id=public_id)


CHART = Chart("sweep-chart", 860, 300, left=56, right=14, top=14, bottom=30)
_PERCENTS = (0, 25, 50, 75, 100)


def progress_chart(rows: Sequence[TrialRow]) -> str:
    """Empty before the first evaluation. Above 100 % stand whole laps, the faster the higher."""
    drawn = [row for row in rows if row.points]
    if not drawn:
        return ""
    longest = max(row.points[-1][0] for row in drawn)
    highest = max(100.0, *(score_of(progress, lap) for row in drawn for _s, progress, lap in row.points)) * 1.02
    fastest = min((lap for row in drawn for _s, progress, lap in row.points if lap and progress >= 100.0), default=None)
    marks = [(1 - percent / highest, f"{percent} %") for percent in _PERCENTS]
    if fastest is not None:
        marks.append((1 - score_of(100.0, fastest) / highest, f"{fastest / 1000:.1f} s"))
    lines = []
    for row in sorted(drawn, key=lambda row: row.state == "best"):
        best = accumulate((score_of(progress, lap) for _s, progress, lap in row.points), max)
        places = [(point[0] / longest, 1 - value / highest) for point, value in zip(row.points, best, strict=True)]
        number = row.trial.number
        x, y = places[-1]
        lines.append(
            f'<g class="sweep-trial {row.state}"><title>{escape(_("Trial %(number)s") % {"number": number})}</title>'
            f'<path d="{CHART.line([(0.0, places[0][1]), *places])}"/>'
            f'<circle cx="{CHART.x(x):.1f}" cy="{CHART.y(y):.1f}" r="3"/></g>'
        )
    seconds = [(share, f"{longest * share:.0f} s") for share in (0.25, 0.5, 0.75)]
    title = _("Best progress of each trial over its seconds of training")
    return "".join((CHART.begin(title), CHART.scale(marks), *lines, CHART.labels(seconds), "</svg>"))
