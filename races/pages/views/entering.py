"""Joining a race, submitting models and withdrawing."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from accounts.request_racer import racer_of
from core.forms import explain
from core.pages.faults import faults_reported, report_fault
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races.boards.ranking import rule_for
from races.entries.selectors.lists import entry_of
from races.entries.selectors.visibility import can_see_race, race_invited_to
from races.entries.services.entries import accept_invitation, enter_race, withdraw
from races.entries.services.submissions import submit_model
from races.models import Race

from ...web.views import visible_race

# where a guest's session keeps the invitation that they have accepted before they log in
ACCEPTED = "accepted_invitation"


@login_required
@require_POST
def enter(request: HttpRequest, slug: str) -> HttpResponse:
    race = visible_race(request, slug)
    with faults_reported(request):
        enter_race(race=race, racer=racer_of(request), now=timezone.now(), terms=_accepted(request))
        messages.success(request, _("You have joined. Submit a car."))
    return redirect(race)


@login_required
@require_POST
def submit(request: HttpRequest, slug: str) -> HttpResponse:
    """Submit a model to a race, and enter its racer if needed."""
    race = visible_race(request, slug)
    model = models_of(request.user).filter(public_id=request.POST.get("model", "")).first()
    try:
        if model is None:
            raise UserFault("model_not_yours")
        submission = submit_model(
            race=race, racer=racer_of(request), model=model, now=timezone.now(), terms=_accepted(request)
        )
    except UserFault as fault:
        report_fault(request, fault)
        # there the box to tick is
        return HttpResponseRedirect(
            f"{race.get_absolute_url()}#send" if fault.code == "race_terms" else _back(request, race)
        )
    if request.POST.get("watch"):
        return redirect(submission.evaluation)
    return redirect(race)


def _accepted(request: HttpRequest) -> int | None:
    """The version of a race's terms whose box is ticked."""
    sent = request.POST.get("terms", "")
    return int(sent) if sent.isdecimal() and len(sent) < 6 else None


def _back(request: HttpRequest, race: Race) -> str:
    """The model's page for a form on it, else the race's."""
    if request.POST.get("from") == "model":
        return reverse("model", args=[request.POST.get("model", "")])
    return race.get_absolute_url()


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def withdraw_page(request: HttpRequest, slug: str) -> HttpResponse:
    """Withdraw from a race, after a confirmation."""
    race = visible_race(request, slug)
    entry = entry_of(race, request.user)
    if entry is None or entry.is_withdrawn:
        raise Http404
    if request.method == "POST":
        with faults_reported(request):
            withdraw(entry=entry, now=timezone.now())
            messages.success(request, _("You have withdrawn. Enter again to restore your results."))
        # leaving a race by invitation ends the permission to see it
        return redirect(race if can_see_race(request.user, race) else "races")
    return render(request, "races/pages/withdraw.html", {"race": race})


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def race_invitation(request: HttpRequest, token: str) -> HttpResponse:
    """The page of an invitation link: the race, and a button to join it.

    The session keeps a guest's acceptance until they return logged in. The referrer policy stays ``same-origin``: with
    ``no-referrer`` browsers send ``Origin: null``, which the CSRF check refuses."""
    race = race_invited_to(token)
    if race is None:
        return render(request, "races/pages/invitation.html", {"race": None}, status=404)
    now = timezone.now()
    entry = entry_of(race, request.user)
    if entry is not None and not entry.is_withdrawn:
        return redirect(race)
    if request.user.is_authenticated:
        kept = request.session.pop(ACCEPTED, None)
        if request.method == "POST":
            return _join(request, race, token, _accepted(request))
        if isinstance(kept, dict) and kept["token"] == token and kept["terms"] == (race.terms_version or None):
            return _join(request, race, token, kept["terms"])
    elif request.method == "POST":
        request.session[ACCEPTED] = {"token": token, "terms": _accepted(request)}
        way = "account_signup" if request.POST.get("with") == "signup" else "account_login"
        return redirect(f"{reverse(way)}?next={request.path}")
    context = {"race": race, "state": race.state_at(now), "ranking_rule": rule_for(race).rule(race)}
    if entry is not None and entry.removed_at:
        context["not_for_me"] = explain(UserFault("entry_removed"))
    return render(request, "races/pages/invitation.html", context)


def _join(request: HttpRequest, race: Race, token: str, terms: int | None) -> HttpResponse:
    with faults_reported(request):
        accept_invitation(token=token, racer=racer_of(request), now=timezone.now(), terms=terms)
        messages.success(request, _("You have joined. Submit a car."))
        return redirect(race)
    return redirect(request.path)
