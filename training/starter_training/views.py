"""The button that trains a first car."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods

from accounts.request_racer import racer_of
from core.pages.faults import report_fault
from paddock.errors import PaddockError
from races.web.names import named

from .services import train_first_car


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def training_first(request: HttpRequest) -> HttpResponse:
    """Train my first car: one click, no form. A GET, for example after logging in, leads to the list."""
    if request.method != "POST":
        return redirect("trainings")
    try:
        job = train_first_car(owner=racer_of(request), now=timezone.now())
    except PaddockError as fault:
        report_fault(request, fault)
        return redirect("trainings")
    if job.submit_to_race is None:
        messages.success(request, _("Training your first car. This page updates itself."))
    else:
        text = _("Training your first car. It is submitted to %(race)s when done.")
        messages.success(request, text % {"race": named(job.submit_to_race.name)})
    return redirect(job)
