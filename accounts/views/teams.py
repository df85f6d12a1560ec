"""Pages of teams."""

from __future__ import annotations

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import ValidationError
from django.core.paginator import Paginator
from django.db.models import Count
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from core.addresses import origin_of
from core.forms import add_fault, explain
from paddock.errors import UserFault

from ..models import Racer, Team, TeamInvitation
from ..teams import services
from ..who import racer_of

ROWS = 100


class TeamForm(forms.Form):
    """What a team is called."""

    name = forms.CharField(label=gettext_lazy("Name"), max_length=64)


@require_safe
def teams(request: HttpRequest) -> HttpResponse:
    """All teams, the reader's own, and who asks the reader to join."""
    listed = Team.objects.select_related("captain").annotate(member_count=Count("members"))
    page = Paginator(listed.order_by("name", "pk"), ROWS).get_page(request.GET.get("page"))
    context: dict = {"page": page}
    if isinstance(request.user, Racer):
        asked = TeamInvitation.objects.filter(racer=request.user).select_related("team__captain")
        context |= {"mine": services.team_of(request.user), "asked": asked}
    return render(request, "accounts/teams/list.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def team_new(request: HttpRequest) -> HttpResponse:
    """Found a team."""
    form = TeamForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        try:
            team = services.found_team(by=racer_of(request), name=form.cleaned_data["name"], now=timezone.now())
        except UserFault as fault:
            add_fault(form, fault)
        except ValidationError as error:
            form.add_error(None, error.messages)
        else:
            messages.success(request, _("The team is founded. You are its captain."))
            return redirect(team)
    return render(request, "accounts/teams/new.html", {"form": form}, status=422 if form.errors else 200)


@require_http_methods(["GET", "HEAD", "POST"])
def team(request: HttpRequest, slug: str) -> HttpResponse:
    """A team and its members. A POST by its captain does what its button ``do`` says, to the racer ``racer``."""
    shown = get_object_or_404(Team.objects.select_related("captain"), slug=slug)
    if request.method == "POST":
        return _do(request, shown)
    leads = services.is_captain(request.user, shown)
    context = {
        "team": shown,
        "members": shown.members.select_related("racer").order_by("joined_at", "pk"),
        "leads": leads,
        "inside": isinstance(request.user, Racer) and shown.members.filter(racer=request.user).exists(),
        "asked": services.invitations_visible_to(request.user).filter(team=shown) if leads else (),
        "mine": services.invitations_visible_to(request.user).filter(team=shown, racer=request.user.pk).first(),
        "link": f"{origin_of(request)}{reverse('team_join', args=[shown.code])}" if leads else "",
    }
    return render(request, "accounts/teams/team.html", context)


def _do(request: HttpRequest, shown: Team) -> HttpResponse:
    by, now, do = racer_of(request), timezone.now(), request.POST.get("do", "")
    alias = request.POST.get("racer", "")
    try:
        if do == "invite":
            services.invite_to_team(team=shown, alias=alias, by=by, now=now)
        elif do == "link":
            services.new_team_link(team=shown, by=by)
        elif do in ("accept", "decline"):
            asked = services.invitations_visible_to(by).filter(team=shown, racer__alias=alias or by.alias).first()
            if asked is None:
                raise Http404
            if do == "accept":
                services.accept_team(invitation=asked, racer=by, now=now)
            else:
                services.decline_team(invitation=asked, by=by)
        elif do in ("remove", "hand_over"):
            racer = get_object_or_404(Racer, alias=alias)
            if do == "remove":
                services.remove_from_team(team=shown, racer=racer, by=by)
            else:
                services.hand_over_team(team=shown, to=racer, by=by)
        else:
            raise Http404
    except UserFault as fault:
        messages.error(request, explain(fault))
    else:
        messages.success(request, _("Saved."))
    return redirect(shown if Team.objects.filter(pk=shown.pk).exists() else "teams")


@never_cache
@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def team_join(request: HttpRequest, code: str) -> HttpResponse:
    """The link of a team: who it is, and a button to join."""
    found = Team.objects.filter(code=code).select_related("captain").first()
    if found is None:
        return render(request, "accounts/groups/no_link.html", status=404)
    if request.method == "POST":
        try:
            services.join_by_link(code=code, racer=racer_of(request), now=timezone.now())
        except UserFault as fault:
            messages.error(request, explain(fault))
            return redirect(request.path)
        messages.success(request, _("You are in the team."))
        return redirect(found)
    return render(request, "accounts/teams/join.html", {"team": found})


@login_required
@require_POST
def team_leave(request: HttpRequest) -> HttpResponse:
    """Be in no team any more."""
    try:
        services.leave_team(racer=racer_of(request))
    except UserFault as fault:
        messages.error(request, explain(fault))
    else:
        messages.success(request, _("You have left the team."))
    return redirect("teams")
