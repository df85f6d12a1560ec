"""Signing up by invitation, and how much of the site a racer has used."""

from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from core.streams.shared_pieces import shared_piece, shared_value

from ..models import Racer
from ..quotas import all_quotas
from ..request_racer import racer_of
from .selectors import racers_by_use, usage_of, usage_rows
from .storage import STORAGE_QUOTA, stored_by

RACERS_PER_PAGE = 50


@login_required
@require_safe
def usage(request: HttpRequest) -> HttpResponse:
    racer = racer_of(request)
    stored = stored_by(racer)
    counted = {STORAGE_QUOTA: {racer.pk: sum(each.mb for each in stored)}}
    context = {"usage": usage_of(racer, timezone.now(), counted=counted), "stored": stored}
    return render(request, "accounts/usage/usage.html", context)


@login_required
@require_safe
def usage_of_all(request: HttpRequest) -> HttpResponse:
    """For admins: all racers who use anything of one quota, the greatest use first, with all their quotas."""
    if not request.user.is_staff:
        raise PermissionDenied
    now = timezone.now()
    quotas = all_quotas()
    by = next((quota for quota in quotas if quota.name == request.GET.get("by")), quotas[0])
    ranked = shared_value(("racers by use", by.name), lambda: racers_by_use(by, now))
    page = Paginator(ranked, RACERS_PER_PAGE).get_page(request.GET.get("page"))
    may_change = request.user.has_perm("accounts.change_racer")

    def values() -> dict[str, object]:
        racers = Racer.objects.in_bulk(list(page.object_list))
        rows = usage_rows([racers[pk] for pk in page.object_list if pk in racers], now)
        return {"rows": rows, "quotas": quotas, "by": by, "may_change": may_change}

    table = shared_piece("accounts/usage/parts/usage_table.html", values, key=(by.name, page.number, may_change))
    context = {"page": page, "table": table, "quotas": quotas, "by": by, "here": "usage"}
    return render(request, "accounts/usage/usage_of_all.html", context)
