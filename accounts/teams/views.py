"""Pages of teams."""

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
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
from core.pages.faults import faults_reported, faults_shown
from core.pages.pager import LeanPaginator

from ..models import Racer, Team, TeamInvitation
from ..request_racer import racer_of
from . import services

ROWS = 100


class TeamForm(forms.Form):
    name = forms.CharField(label=gettext_lazy("Name"), max_length=64)


@require_safe
def teams(request: HttpRequest) -> HttpResponse:
    listed = Team.objects.select_related("captain").annotate(member_count=Count("members"))
    page = LeanPaginator(listed.order_by("name", "pk"), ROWS).get_page(request.GET.get("page"))
    context: dict = {"page": page}
    if isinstance(request.user, Racer):
        asked = TeamInvitation.objects.filter(racer=request.user).select_related("team__captain")
        context |= {"mine": services.team_of(request.user), "asked": asked}
    return render(request, "accounts/teams/list.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def team_new(request: HttpRequest) -> HttpResponse:
    form = TeamForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            team = services.found_team(by=racer_of(request), name=form.cleaned_data["name"], now=timezone.now())
            messages.success(request, _("The team is founded. You are its captain."))
            return redirect(team)
    return render(request, "accounts/teams/new.html", {"form": form}, status=422 if form.errors else 200)


@require_http_methods(["GET", "HEAD", "POST"])
def team(request: HttpRequest, slug: str) -> HttpResponse:
    """A team and its members. A POST by its captain performs the action of its button ``do`` on the racer ``racer``."""
    shown = get_object_or_404(Team.objects.select_related("captain"), slug=slug)
    if request.method == "POST":
        return _do(request, shown)
    leads = services.is_captain(request.user, shown)
    members = list(shown.members.select_related("racer").order_by("joined_at", "pk"))
    inside = any(member.racer_id == request.user.pk for member in members)
    invitations = services.invitations_visible_to(request.user).filter(team=shown)
    context = {
        "team": shown,
        "members": members,
        "leads": leads,
        "inside": inside,
        "asked": invitations if leads else (),
        "mine": None if inside else invitations.filter(racer=request.user.pk).first(),
        "link": f"{origin_of(request)}{reverse('team_join', args=[shown.code])}" if leads else "",
    }
    return render(request, "accounts/teams/team.html", context)


@login_required
def _do(request: HttpRequest, shown: Team) -> HttpResponse:
    by, now, do = racer_of(request), timezone.now(), request.POST.get("do", "")
    alias = request.POST.get("racer", "")
    with faults_reported(request):
        if do == "invite":
            services.invite_to_team(team=shown, alias=alias, by=by, now=now)
        elif do == "link":
            services.new_team_link(team=shown, by=by)
        elif do in ("accept", "decline"):
            visible = services.invitations_visible_to(by)
            asked = get_object_or_404(visible, team=shown, racer__alias=alias or by.alias)
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
        messages.success(request, _("Saved."))
    return redirect(shown if Team.objects.filter(pk=shown.pk).exists() else "teams")


@never_cache
@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def team_join(request: HttpRequest, code: str) -> HttpResponse:
    """The page of a team's link, with a button to join."""
    found = Team.objects.filter(code=code).select_related("captain").first()
    if found is None:
        return render(request, "accounts/parts/no_link.html", status=404)
    if request.method == "POST":
        with faults_reported(request):
            services.join_by_link(code=code, racer=racer_of(request), now=timezone.now())
            messages.success(request, _("You are in the team."))
            return redirect(found)
        return redirect(request.path)
    return render(request, "accounts/teams/join.html", {"team": found})


@login_required
@require_POST
def team_leave(request: HttpRequest) -> HttpResponse:
    with faults_reported(request):
        services.leave_team(racer=racer_of(request))
        messages.success(request, _("You have left the team."))
    return redirect("teams")
