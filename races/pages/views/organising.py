"""The organiser's pages: create, change and cancel a race, invite and remove racers."""

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
from accounts.request_racer import racer_of
from core.forms import say_saved, warn_of_ignored
from core.pages.faults import faults_reported
from paddock.errors import UserFault
from races.boards.selectors.counts import cars_waiting
from races.entries.selectors.cars import shared_cars
from races.entries.services.entries import remove_entry, restore_entry
from races.entries.terms import with_accepted_terms
from races.models import Entry, LiveEvent, Opponents, Race, RaceKind, RaceState, Visibility
from races.models.live import OVER
from races.pages import services
from races.pages.forms import RaceForm, ReasonForm, locked_fields
from races.rules.layout_form import LayoutForm, preview
from races.rules.validation import changed_fields
from races.web.audit_log import log_if_admin
from races.web.spectator_links import spectator_token
from tracks.selectors import track_named

from ...web.views import organised_race

RACERS_PER_PAGE = 100


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_new(request: HttpRequest) -> HttpResponse:
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
    return render(request, "races/pages/form.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def race_layout(request: HttpRequest) -> HttpResponse:
    """Preview of an unsaved layout: a map with its boxes, or the errors."""
    return render(request, "races/rules/layout.html", {"layout": preview(LayoutForm(request.POST), submitted=False)})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_edit(request: HttpRequest, slug: str) -> HttpResponse:
    """Change a race, except for its locked fields."""
    race = organised_race(request, slug)
    now = timezone.now()
    locked = locked_fields(race, now, submissions=services.has_submissions(race))
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
        "invitation_url": request.build_absolute_uri(reverse("race_invitation", args=[race.invitation])),
        "spectator_url": request.build_absolute_uri(reverse("live_watch", args=[spectator_token(race)])),
        "is_over": state in (RaceState.CLOSED, RaceState.CANCELLED),
        "is_league": race.kind == RaceKind.LEAGUE,
        "rules_are_fixed": "laps" in locked,
    }
    return render(request, "races/pages/form.html", context, status=422 if form.errors else 200)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_cancel(request: HttpRequest, slug: str) -> HttpResponse:
    race = organised_race(request, slug)
    form = ReasonForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_reported(request):
            services.cancel_race(race=race, reason=form.cleaned_data["reason"], now=timezone.now())
            log_if_admin(racer_of(request), race, f"Cancelled: {form.cleaned_data['reason']}")
            messages.success(request, _("Race cancelled."))
        return redirect(race)
    return render(request, "races/pages/cancel.html", {"race": race, "form": form}, status=422 if form.errors else 200)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def race_close(request: HttpRequest, slug: str) -> HttpResponse:
    """Say what follows, then close an open race before its time."""
    race = organised_race(request, slug)
    now = timezone.now()
    live = LiveEvent.objects.filter(race=race).exclude(state__in=OVER).first()
    if request.method == "POST":
        shows_live = request.POST.get("duels") == "live"
        with faults_reported(request):
            services.close_race(race=race, now=now, duels_live_only=shows_live)
            log_if_admin(racer_of(request), race, "Closed before its time")
            if shows_live:
                messages.success(request, _("The race is closed. Its duels wait for the live event."))
                return redirect("live_plan", race.slug)
            messages.success(request, _("Race closed."))
        return redirect(race)
    context = {"race": race, "is_open": race.state_at(now) == RaceState.OPEN, "waiting": cars_waiting(race)}
    warns = race.opponents == Opponents.MODELS and live is None and not race.duels_live_only
    context |= {"live": live, "warns": warns}
    return render(request, "races/pages/close.html", context)


@login_required
@require_POST
def invitation_reset(request: HttpRequest, slug: str) -> HttpResponse:
    race = organised_race(request, slug)
    services.reset_invitation(race=race)
    messages.success(request, _("New link created. The old one no longer works. Racers who joined stay in the race."))
    return redirect("race_edit", race.slug)


@login_required
@require_POST
def spectator_link_renew(request: HttpRequest, slug: str) -> HttpResponse:
    race = organised_race(request, slug)
    services.renew_spectator_link(race=race, now=timezone.now())
    messages.success(request, _("The spectators' link is new. The old one opens nothing any more."))
    return redirect(f"{reverse('race_edit', args=[race.slug])}#spectators")


@login_required
@require_safe
def race_racers(request: HttpRequest, slug: str) -> HttpResponse:
    race = organised_race(request, slug)
    entries = Entry.objects.filter(race=race, is_baseline=False).select_related("racer").order_by("entered_at", "pk")
    page = Paginator(with_accepted_terms(entries), RACERS_PER_PAGE).get_page(request.GET.get("page"))
    context = {"race": race, "page": page, "shared": shared_cars(race)}
    return render(request, "races/pages/racers.html", context)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def racer_remove(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    race = organised_race(request, slug)
    entry = get_object_or_404(
        Entry.objects.select_related("racer", "race"), race=race, racer__alias=alias, removed_at=None, is_baseline=False
    )
    form = ReasonForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_reported(request):
            remove_entry(entry=entry, by=racer_of(request), now=timezone.now(), reason=form.cleaned_data["reason"])
            log_if_admin(racer_of(request), entry, f"Removed: {form.cleaned_data['reason']}")
            messages.success(request, _("%(alias)s is removed from the race.") % {"alias": alias})
        return redirect("race_racers", race.slug)
    context = {"race": race, "entry": entry, "form": form}
    return render(request, "races/pages/remove.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def racer_restore(request: HttpRequest, slug: str, alias: str) -> HttpResponse:
    race = organised_race(request, slug)
    entry = get_object_or_404(Entry, race=race, racer__alias=alias, removed_at__isnull=False)
    with faults_reported(request):
        restore_entry(entry=entry, by=racer_of(request))
        log_if_admin(racer_of(request), entry, "Restored")
        messages.success(request, _("%(alias)s is back in the race.") % {"alias": alias})
    return redirect("race_racers", race.slug)
