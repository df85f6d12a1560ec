"""Reports on pages: the list, the form, one of them, two side by side."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.models import Racer
from accounts.quotas import Usage
from accounts.request_racer import racer_of
from accounts.usage.selectors import usage_of
from core.pages.faults import faults_reported
from core.pages.live_parts import live_part
from core.pages.pager import LeanPaginator
from core.streams.shared_pieces import shared_piece, shared_value
from paddock.errors import UserFault

from ..models import State
from ..models.reports import CarReport
from ..selectors import can_see_model
from . import quotas, services
from .forms import ReportForm
from .grading import GRADES
from .picture import crosses, map_box, variation_picture
from .selectors import (
    ReportFigures,
    can_stop_report,
    compared,
    figures_of,
    is_report_of,
    reports_of,
    reports_visible_to,
    workers_at,
)

PER_PAGE = 30
COMPARED_WITH = 50  # of my finished reports, the latest are offered


@login_required
@require_safe
def reports(request: HttpRequest) -> HttpResponse:
    racer = racer_of(request)
    page = LeanPaginator(reports_of(racer), PER_PAGE).get_page(request.GET.get("page"))
    return render(request, "evaluation/reports/reports.html", {"page": page, "quotas": _quotas(racer)})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def report_new(request: HttpRequest) -> HttpResponse:
    racer = racer_of(request)
    form = ReportForm(request.POST or None, racer=racer, initial={"model": request.GET.get("model", "")[:12]})
    if request.method == "POST" and form.is_valid():
        try:
            return redirect(services.request_report(owner=racer, now=timezone.now(), **form.values(racer)))
        except UserFault as fault:
            form.show(fault)
    context = {"form": form, "quotas": _quotas(racer), "drives": _drives(form)}
    return render(request, "evaluation/reports/new.html", context, status=422 if form.errors else 200)


def _drives(form: ReportForm) -> SafeString:
    """The fields of a form that are the same for every reader until it is sent."""
    template = "evaluation/reports/drives.html"
    if form.is_bound:
        return render_to_string(template, {"drives": form})
    return shared_piece(template, lambda: {"drives": ReportForm(racer=None)}, key="new report")


@login_required
@require_safe
def report(request: HttpRequest, public_id: str) -> HttpResponse:
    """One report; while it is driven, the page renews itself. ``with``: another one beside it."""
    shown = _visible(request, public_id)
    response = render(request, "evaluation/reports/page.html", _context(request, shown))
    if not shown.is_final:
        response["Cache-Control"] = "private, no-store"
    return response


@login_required
@require_safe
def report_live(request: HttpRequest, public_id: str) -> HttpResponse:
    """The part that changes while a report is driven; all of it once that is done."""
    shown = _visible(request, public_id)
    template, whole = ("report.html", "#report") if shown.is_final else ("live.html", "")
    return live_part(request, _mark(shown), f"evaluation/reports/{template}", lambda: _context(request, shown), whole)


@login_required
@require_POST
def report_stop(request: HttpRequest, public_id: str) -> HttpResponse:
    shown = _visible(request, public_id)
    if can_stop_report(request.user, shown):
        services.stop_report(report=shown, now=timezone.now())
    return redirect(shown)


@login_required
@require_POST
def report_again(request: HttpRequest, public_id: str) -> HttpResponse:
    mine = _mine(request, public_id)
    with faults_reported(request):
        return redirect(services.drive_report_again(report=mine, now=timezone.now()))
    return redirect(mine)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def report_delete(request: HttpRequest, public_id: str) -> HttpResponse:
    mine = _mine(request, public_id)
    if request.method == "POST":
        with faults_reported(request):
            services.delete_report(report=mine, now=timezone.now())
            messages.success(request, _("Report deleted."))
            return redirect("reports")
        return redirect(mine)
    return render(request, "evaluation/reports/delete.html", {"report": mine})


def _visible(request: HttpRequest, public_id: str) -> CarReport:
    return get_object_or_404(reports_visible_to(request.user), public_id=public_id)


def _mine(request: HttpRequest, public_id: str) -> CarReport:
    shown = _visible(request, public_id)
    if not is_report_of(request.user, shown):
        raise Http404
    return shown


def _context(request: HttpRequest, shown: CarReport) -> dict[str, object]:
    context: dict[str, object] = {
        "report": shown,
        "is_mine": is_report_of(request.user, shown),
        "can_stop": can_stop_report(request.user, shown),
        "shows_model": can_see_model(request.user, shown.model),
        "mark": _mark(shown),
        "share": 100 * shown.driven // shown.laps_in_all if shown.laps_in_all else 0,  # type: ignore[attr-defined]
    }
    if not shown.is_final:
        return context | {"workers": workers_at(shown)}
    if shown.state != State.FINISHED:
        return context
    key = ("report", shown.pk, shown.runs_sha256)  # a finished report does not change
    figures = shared_value(key, lambda: figures_of(shown))
    drawn = shared_piece("evaluation/reports/figures.html", lambda: _drawn(shown, figures), key=key)
    context |= {"figures": figures, "drawn": drawn}
    others = reports_of(request.user).filter(state=State.FINISHED).exclude(pk=shown.pk)
    context["others"] = list(others[:COMPARED_WITH])
    beside = request.GET.get("with")
    other = others.filter(public_id=beside).first() if beside else None
    if other is not None:
        context["compared"] = compared(shown, figures, other, figures_of(other))
    return context


def _drawn(shown: CarReport, figures: ReportFigures) -> dict[str, object]:
    context: dict[str, object] = {"report": shown, "figures": figures, "grades": GRADES}
    if figures.varied and shown.variations_on is not None:
        context["picture"] = variation_picture(figures.varied)
        context["crosses"] = crosses(shown.variations_on, figures.varied)
        context["map_box"] = map_box(shown.variations_on)
    return context


def _mark(shown: CarReport) -> str:
    return f"{shown.state} {shown.driven}"  # type: ignore[attr-defined]


def _quotas(racer: Racer) -> list[Usage]:
    return usage_of(racer, timezone.now(), only=[quota.name for quota in quotas.ALL])
