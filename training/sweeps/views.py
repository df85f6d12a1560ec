"""The pages of sweeps."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.request_racer import racer_of
from core.forms import explain
from paddock.errors import UserFault

from ..models import Sweep
from .charts import progress_chart
from .halving import plan
from .selectors import (
    can_delete_sweep,
    can_stop_sweep,
    dimension_label,
    importances,
    rows_of,
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
