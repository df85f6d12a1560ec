"""The operators' pages: workers, queues, failed jobs and their retry."""

from datetime import timedelta
from urllib.parse import urlencode

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.core.paginator import Paginator
from django.db.models import QuerySet
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from accounts.request_racer import racer_of
from config.operations.workers import failed_runs, queues_at, retry_jobs, workers_at
from core.database.clock import database_now
from core.jobs.queues import Queue, all_queues
from evaluation.models import StoredFile
from races.boards.selectors.counts import races_driven_again
from races.web.audit_log import log_many

from .status import PARTS, service_status, status_chart

PER_PAGE = 50
# How far back a filter may look, in hours; 0: all that there is.
HOURS = (1, 6, 24, 168, 0)
MOST_AT_ONCE = 1000
DAMAGED_SHOWN = 20
GUIDE = "/guides/operators/"
# label, advice, and place in the guide of each area of the doctor
AREAS = {
    "Readiness": (gettext_lazy("Parts of the site"), gettext_lazy("Start what does not answer."), "#health"),
    "Workers": (gettext_lazy("Workers and queues"), gettext_lazy("Start the missing programs again."), "#health"),
    "Files": (
        gettext_lazy("Files and storage"),
        gettext_lazy("Put damaged files back from a backup, and make room before the disk is full."),
        "#damaged-files",
    ),
    "Engine": (
        gettext_lazy("Repeated races"),
        gettext_lazy("Upgrade workers that still drive with an older engine."),
        "#a-new-engine",
    ),
    "Seasons": (
        gettext_lazy("Seasons"),
        gettext_lazy("Let the season continue, or copy it to later months."),
        "#status-and-needs",
    ),
    "Messages": (
        gettext_lazy("Mails and webhooks"),
        gettext_lazy("Check the mail server, then the addresses that refuse."),
        "#notices",
    ),
    "Programs": (gettext_lazy("Programs"), gettext_lazy("Name an owner, or disable the program."), "#programs"),
}
READ, RUN = "evaluation.view_workernode", "evaluation.change_evaluation"


@login_required
@never_cache
@require_safe
def workers(request: HttpRequest) -> HttpResponse:
    _require(request, READ)
    now = database_now()
    shown = workers_at(now)
    context = {"workers": shown, "queues": queues_at(now, shown), "driven_again": races_driven_again(), "now": now}
    context["damaged"] = StoredFile.objects.exclude(damage="").order_by("damaged_at")[:DAMAGED_SHOWN]
    return render(request, "config/operations/workers.html", context)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def failed(request: HttpRequest, name: str) -> HttpResponse:
    """What failed in a queue, by reason, worker and time; and all that the filter finds, run again."""
    _require(request, READ if request.method != "POST" else RUN)
    queue = next((one for one in all_queues() if one.name == name), None)
    if queue is None:
        raise Http404
    given = request.GET if request.method != "POST" else request.POST
    reason, worker = given.get("reason", ""), given.get("worker", "")
    hours = int(given["hours"]) if given.get("hours") in [str(one) for one in HOURS] else 1
    after = database_now() - timedelta(hours=hours) if hours else None
    rows = failed_runs(queue, reason=reason, worker=worker, after=after).select_related(*queue.related)
    if request.method == "POST":
        _run_again(request, queue, rows)
        query = urlencode({"reason": reason, "worker": worker, "hours": hours})
        return redirect(f"{reverse('failed_runs', args=[queue.name])}?{query}")
    everything = failed_runs(queue, after=after).order_by()
    page = Paginator(rows, PER_PAGE).get_page(given.get("page"))
    context = {
        "queue": queue,
        "queues": all_queues(),
        "may_run": request.user.has_perm(RUN),
        "page": page,
        "count": page.paginator.count,
        "most": MOST_AT_ONCE,
        "reason": reason,
        "worker": worker,
        "hours": hours,
        "choices_of_hours": HOURS,
        "reasons": everything.values_list("reason_code", flat=True).distinct().order_by("reason_code"),
        "workers": everything.exclude(worker="").values_list("worker", flat=True).distinct().order_by("worker"),
    }
    return render(request, "config/operations/failed_runs.html", context)


@login_required
@never_cache
@require_safe
def needs(request: HttpRequest) -> HttpResponse:
    """What an admin should look at, by area."""
    _require(request, READ)
    from .doctor import needs_a_hand  # loads the simulator

    found = needs_a_hand()
    areas = [
        {"name": name.lower(), "label": label, "advice": advice, "guide": GUIDE + anchor, "findings": findings}
        for name, (label, advice, anchor) in AREAS.items()
        if (findings := [finding for finding in found if finding.area == name])
    ]
    return render(request, "config/operations/needs.html", {"areas": areas})


@require_safe
def status(request: HttpRequest) -> HttpResponse:
    """The public status page."""
    shown = service_status()
    context = {
        "status": shown,
        "parts": [(label, shown.parts[name]) for name, label in PARTS.items()],
        "chart": status_chart(shown.days),
        "newest_first": shown.days[::-1],
    }
    return render(request, "config/operations/status.html", context)


def _require(request: HttpRequest, permission: str) -> None:
    if not (request.user.is_staff and request.user.has_perm(permission)):
        raise PermissionDenied


def _run_again(request: HttpRequest, queue: Queue, rows: QuerySet) -> None:
    jobs = list(rows[:MOST_AT_ONCE])
    report = retry_jobs(queue=queue, jobs=jobs, now=timezone.now())
    if report.queued:
        text = ngettext("%d run queued again.", "%d runs queued again.", report.queued)
        messages.success(request, text % report.queued)
        log_many(racer_of(request), jobs, "Run again")
    for sentence, count in report.refused.items():
        text = ngettext("%(count)d unchanged: %(why)s", "%(count)d unchanged: %(why)s", count)
        why = sentence or _("Another task with this name is running.")
        messages.error(request, text % {"count": count, "why": why})
    if not report.queued and not report.refused:
        messages.info(request, _("There is nothing to run again."))
