"""Getting into a race, sending cars, getting out of it."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from accounts.who import racer_of
from core.forms import explain
from evaluation.selectors import models_of
from paddock.errors import UserFault
from races import services
from races.models import Race, Visibility
from races.ranking import rule_for
from races.selectors import can_see_race, entry_of

from .common import tell_fault, visible_race

# where a guest's session keeps the invitation that they have accepted before they log in
ACCEPTED = "accepted_invitation"


@login_required
@require_POST
def enter(request: HttpRequest, slug: str) -> HttpResponse:
    """Enter a race."""
    race = visible_race(request, slug)
    try:
        services.enter_race(race=race, racer=racer_of(request), now=timezone.now(), terms=_accepted(request))
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        messages.success(request, _("You have joined. Submit a car."))
    return redirect(race)


@login_required
@require_POST
def submit(request: HttpRequest, slug: str) -> HttpResponse:
    """Send one of my models to a race; whoever is not in yet is entered."""
    race = visible_race(request, slug)
    model = models_of(request.user).filter(public_id=request.POST.get("model", "")).first()
    try:
        if model is None:
            raise UserFault("model_not_yours")
        submission = services.submit_model(
            race=race, racer=racer_of(request), model=model, now=timezone.now(), terms=_accepted(request)
        )
    except UserFault as fault:
        tell_fault(request, fault)
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
    """The model's page for a form that stands there, else the race's."""
    if request.POST.get("from") == "model":
        return reverse("model", args=[request.POST.get("model", "")])
    return race.get_absolute_url()


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def withdraw_page(request: HttpRequest, slug: str) -> HttpResponse:
    """Ask, then take me out of a race."""
    race = visible_race(request, slug)
    entry = entry_of(race, request.user)
    if entry is None or entry.is_withdrawn:
        raise Http404
    if request.method == "POST":
        try:
            services.withdraw(entry=entry, now=timezone.now())
        except UserFault as fault:
            tell_fault(request, fault)
        else:
            messages.success(request, _("You have withdrawn. Enter again to restore your results."))
        # a race by invitation is not seen any more by who has left it
        return redirect(race if can_see_race(request.user, race) else "races")
    return render(request, "races/withdraw.html", {"race": race})


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def race_invitation(request: HttpRequest, token: str) -> HttpResponse:
    """Where an invitation link leads: what the race is, and a button to join it.

    A guest who presses it logs in or signs up first; the session keeps what they pressed, and they come back as one
    who has joined. No page has a policy of its own about referrers: without one a browser says ``Origin: null`` when a
    form is sent, which is refused as a forgery; the site's ``same-origin`` tells nobody else where a reader came from.
    """
    race = Race.objects.select_related("track", "organiser").filter(invitation=token).first()
    if race is None or race.visibility != Visibility.INVITATION:
        return render(request, "races/invitation.html", {"race": None}, status=404)
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
    return render(request, "races/invitation.html", context)


def _join(request: HttpRequest, race: Race, token: str, terms: int | None) -> HttpResponse:
    try:
        services.accept_invitation(token=token, racer=racer_of(request), now=timezone.now(), terms=terms)
    except UserFault as fault:
        tell_fault(request, fault)
        return redirect(request.path)
    messages.success(request, _("You have joined. Submit a car."))
    return redirect(race)
