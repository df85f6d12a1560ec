"""What admins do on the site itself: a whole season from one form."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.admin.models import ADDITION
from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied, ValidationError
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import ngettext
from django.views.decorators.http import require_http_methods

from faults import UserFault
from league.season_form import SeasonForm
from league.services.template import schedule_season
from races.audit import log


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def season_new(request: HttpRequest) -> HttpResponse:
    """Make a season and schedule all its races; for admins who may add seasons."""
    if not request.user.has_perm("league.add_season"):
        raise PermissionDenied
    now = timezone.now()
    form = SeasonForm(request.POST or None, now=now)
    if request.method == "POST" and form.is_valid():
        try:
            season, count = schedule_season(plan=form.plan(), now=now)
        except (UserFault, ValidationError) as refused:
            form.show(refused)
        else:
            log(request.user, season, ADDITION, f"Made from the template with {count} races")
            told = ngettext("The season is made: %d race.", "The season is made: %d races.", count) % count
            messages.success(request, told)
            return redirect(season)
    return render(request, "league/season_form.html", {"form": form}, status=422 if form.errors else 200)
