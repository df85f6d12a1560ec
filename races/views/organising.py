"""What a race's organiser does: make it, change it, invite, remove, cancel."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.paginator import Paginator
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from accounts.groups.selectors import groups_to_hold_for
from accounts.who import racer_of
from core.forms import say_saved, warn_of_ignored
from paddock.errors import UserFault
from races import services
from races.audit import log_if_admin
from races.forms import RaceForm, ReasonForm, locked_fields
from races.layout_form import LayoutForm, preview
from races.models import Entry, LiveEvent, Opponents, Race, RaceKind, RaceState, Visibility
from races.models.live import OVER
from races.selectors.cars import shared_cars
from races.selectors.counting import cars_waiting
from races.selectors.terms import with_accepted_terms
from races.services.races import has_submissions
from races.spectators import spectator_token
from races.validation import changed_fields
from tracks.selectors import track_named

from .common import organised_race, tell_fault

RACERS_PER_PAGE = 100


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_new(request: HttpRequest) -> HttpResponse:
    """Make a community race."""
    now = timezone.now()
    initial: dict[str, object] = {}
    if track := track_named(request.GET.get("track", "")):
        initial["track"] = track.slug
    groups = groups_to_hold_for(racer_of(request))
    if wanted := groups.filter(slug=request.GET.get("group", "")).first():
        initial |= {"group": wanted.pk} | ({} if wanted.is_listed else {"visibility": Visibility.INVITATION})
    form = RaceForm(request.POST or None, now=now, initial=initial, groups=groups, organiser=racer_of(request))
    if request.method == "POST" and form.is_valid():
        try:
            race = services.create_community_race(organiser=racer_of(request), now=now, **form.changes())
        except UserFault as fault:
            form.show(fault)
        else:
            messages.success(request, _("Race created."))
            warn_of_ignored(request, form.ignored())
            return redirect("race_edit" if race.visibility == "invitation" else "race", race.slug)
    context = {"form": form, "layout": preview(form, submitted=form.is_bound)}
    return render(request, "races/form.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def race_layout(request: HttpRequest) -> HttpResponse:
    """The layout that a form says, not saved: a map with its boxes, or why it cannot be so."""
    return render(request, "races/parts/layout.html", {"layout": preview(LayoutForm(request.POST), submitted=False)})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_edit(request: HttpRequest, slug: str) -> HttpResponse:
    """Change a race; its own validation says what may still change."""
    race = organised_race(request, slug)
    now = timezone.now()
    locked = locked_fields(race, now, submissions=has_submissions(race))
    groups = groups_to_hold_for(race.organiser or racer_of(request))
    form = RaceForm(request.POST or None, race=race, locked=locked, now=now, groups=groups)
    if request.method == "POST" and form.is_valid():
        before = Race.objects.get(pk=race.pk)
        try:
            services.edit_race(race=race, now=now, edition=form.cleaned_data["edition"] or None, **form.changes())
        except UserFault as fault:
            form.show(fault)
        else:
            if changed := changed_fields(before, race):
                log_if_admin(racer_of(request), race, f"Edited: {', '.join(changed)}")
            say_saved(request, form, ignored=form.ignored())
            return redirect(race)
    state = race.state_at(now)
    context = {
        "form": form,
        "layout": preview(form, submitted=form.is_bound),
        "race": race,
        "invitation_url": request.build_absolute_uri(_invitation_path(race)),
        "spectator_url": request.build_absolute_uri(reverse("live_watch", args=[spectator_token(race)])),
        "is_over": state in (RaceState.CLOSED, RaceState.CANCELLED),
        "is_league": race.kind == RaceKind.LEAGUE,
        "rules_are_fixed": "laps" in locked,
    }
    return render(request, "races/form.html", context, status=422 if form.errors else 200)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_cancel(request: HttpRequest, slug: str) -> HttpResponse:
    """Ask for a reason, then cancel a race."""
    race = organised_race(request, slug)
    form = ReasonForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        try:
            services.cancel_race(race=race, reason=form.cleaned_data["reason"], now=timezone.now())
        except UserFault as fault:
            tell_fault(request, fault)
        else:
            log_if_admin(racer_of(request), race, f"Cancelled: {form.cleaned_data['reason']}")
            messages.success(request, _("Race cancelled."))
        return redirect(race)
    return render(request, "races/cancel.html", {"race": race, "form": form}, status=422 if form.errors else 200)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_close(request: HttpRequest, slug: str) -> HttpResponse:
    """Say what follows, then close an open race before its time."""
    race = organised_race(request, slug)
    now = timezone.now()
    live = LiveEvent.objects.filter(race=race).exclude(state__in=OVER).first()
    if request.method == "POST":
        shows_live = request.POST.get("duels") == "live"
        try:
            services.close_race(race=race, now=now, duels_live_only=shows_live)
        except UserFault as fault:
            tell_fault(request, fault)
        else:
            log_if_admin(racer_of(request), race, "Closed before its time")
            if shows_live:
                messages.success(request, _("The race is closed. Its duels wait for the live event."))
                return redirect("live_plan", race.slug)
            messages.success(request, _("Race closed."))
        return redirect(race)
    context = {"race": race, "is_open": race.state_at(now) == RaceState.OPEN, "waiting": cars_waiting(race)}
    warns = race.opponents == Opponents.MODELS and live is None and not race.duels_live_only
    context |= {"live": live, "warns": warns}
    return render(request, "races/close.html", context)


@login_required
@require_POST
def invitation_reset(request: HttpRequest, slug: str) -> HttpResponse:
    """Make the old invitation link worthless and give the race a new one."""
    race = organised_race(request, slug)
    services.reset_invitation(race=race)
    messages.success(request, _("New link created. The old one no longer works. Racers who have joined stay."))
    return redirect("race_edit", race.slug)


@login_required
@require_POST
def spectator_link_renew(request: HttpRequest, slug: str) -> HttpResponse:
    """Give a race another spectators' link."""
    race = organised_race(request, slug)
    services.renew_spectator_link(race=race, now=timezone.now())
    messages.success(request, _("The spectators' link is new. The old one opens nothing any more."))
    return redirect(f"{reverse('race_edit', args=[race.slug])}#spectators")


@login_required
@require_safe
def race_racers(request: HttpRequest, slug: str) -> HttpResponse:
    """Who is in a race, for its organiser."""
    race = organised_race(request, slug)
    entries = Entry.objects.filter(race=race, is_baseline=False).select_related("racer").order_by("entered_at", "pk")
    page = Paginator(with_accepted_terms(entries), RACERS_PER_PAGE).get_page(request.GET.get("page"))
    context = {"race": race, "page": page, "shared": shared_cars(race)}
    return render(request, "races/racers.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def racer_remove(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """Ask for a reason, then remove a racer from a race."""
    race = organised_race(request, slug)
    entry = get_object_or_404(
        Entry.objects.select_related("racer", "race"), race=race, racer__alias=alias, removed_at=None, is_baseline=False
    )
    form = ReasonForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        try:
            services.remove_entry(
                entry=entry, by=racer_of(request), now=timezone.now(), reason=form.cleaned_data["reason"]
            )
        except UserFault as fault:
            tell_fault(request, fault)
        else:
            log_if_admin(racer_of(request), entry, f"Removed: {form.cleaned_data['reason']}")
            messages.success(request, _("%(alias)s is removed from the race.") % {"alias": alias})
        return redirect("race_racers", race.slug)
    context = {"race": race, "entry": entry, "form": form}
    return render(request, "races/remove.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def racer_restore(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    """Take a removed racer back."""
    race = organised_race(request, slug)
    entry = get_object_or_404(Entry, race=race, racer__alias=alias, removed_at__isnull=False)
    try:
        services.restore_entry(entry=entry, by=racer_of(request))
    except UserFault as fault:
        tell_fault(request, fault)
    else:
        log_if_admin(racer_of(request), entry, "Restored")
        messages.success(request, _("%(alias)s is back in the race.") % {"alias": alias})
    return redirect("race_racers", race.slug)


def _invitation_path(race: Race) -> str:
    return reverse("race_invitation", args=[race.invitation])
