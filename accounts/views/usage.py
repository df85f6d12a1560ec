"""Signing up by invitation, and how much of the site a racer has used."""

from __future__ import annotations

from django.conf import settings
from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe

from ..quotas import all_quotas, usage_of
from ..selectors import open_invitation, racers_by_use, racers_whose_usage_is_seen_by, usage_rows
from ..sign_up import CODE, INVITATION
from ..storage import stored_by
from ..who import racer_of

RACERS_PER_PAGE = 50


@never_cache
@require_safe
def invitation(request: HttpRequest, code: str) -> HttpResponse:
    """The link of an invitation to sign up: remembered for this visitor, who is sent on to the form."""
    if request.user.is_authenticated:
        return redirect("home")
    if settings.SIGN_UP == INVITATION:
        if open_invitation(code, timezone.now()) is None:
            return render(request, "accounts/invitation_over.html", status=404)
        request.session[CODE] = code
    return redirect("account_signup")


@login_required
@require_safe
def usage(request: HttpRequest) -> HttpResponse:
    """How much of each quota the racer has used."""
    context = {"usage": usage_of(racer_of(request), timezone.now()), "stored": stored_by(racer_of(request))}
    return render(request, "accounts/usage.html", context)


@login_required
@require_safe
def usage_of_all(request: HttpRequest) -> HttpResponse:
    """For admins: all racers who use anything of one quota, the greatest use first, with all their quotas."""
    if not request.user.is_staff:
        raise PermissionDenied
    now = timezone.now()
    quotas = all_quotas()
    by = next((quota for quota in quotas if quota.name == request.GET.get("by")), quotas[0])
    page = Paginator(racers_by_use(by, now), RACERS_PER_PAGE).get_page(request.GET.get("page"))
    racers = racers_whose_usage_is_seen_by(request.user).in_bulk(list(page.object_list))
    rows = usage_rows([racers[pk] for pk in page.object_list if pk in racers], now)
    return render(
        request, "accounts/usage_of_all.html", {"page": page, "rows": rows, "quotas": quotas, "by": by, "here": "usage"}
    )
