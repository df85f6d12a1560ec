"""Pages of followed racers and their latest results."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from accounts.following import follow_racer, followed_by, unfollow_racer
from accounts.request_racer import racer_of
from core.pages.faults import faults_reported

from ..racers.api import shown_racer
from .selectors import doings_of_followed

ROWS = 50


@login_required
@never_cache
@require_safe
def following(request: HttpRequest) -> HttpResponse:
    follows = list(followed_by(request.user))  # as many as the quota allows
    page = Paginator(follows, ROWS).get_page(request.GET.get("page"))
    doings = doings_of_followed(racer_of(request), follows, timezone.now())
    return render(request, "league/following/following.html", {"page": page, "doings": doings})


@login_required
@require_POST
def follow(request: HttpRequest, alias: str) -> HttpResponse:
    racer = shown_racer(request, alias)
    with faults_reported(request):
        follow_racer(follower=racer_of(request), racer=racer, now=timezone.now())
        messages.success(request, _("You follow %(racer)s.") % {"racer": racer.alias})
    return redirect(racer)


@login_required
@require_POST
def unfollow(request: HttpRequest, alias: str) -> HttpResponse:
    """Follow a racer no more, on their page or (``from=list``) in the list."""
    racer = shown_racer(request, alias)
    unfollow_racer(follower=racer_of(request), racer=racer)
    messages.success(request, _("You no longer follow %(racer)s.") % {"racer": racer.alias})
    return redirect("following" if request.POST.get("from") == "list" else racer)
