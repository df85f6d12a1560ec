"""Pages of admins' actions on a whole season: copy, continue or stop, delete it or single races of it."""

from django import forms
from django.contrib import messages
from django.contrib.admin.models import ADDITION, CHANGE, DELETION
from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.http import require_http_methods, require_POST

from accounts.request_racer import racer_of
from core.forms import explain
from core.pages import form_nonce
from core.pages.faults import faults_shown
from league.models import Season
from league.seasons.selectors import why_kept
from league.seasons.services.seasons import delete_round, delete_season, edit_season
from league.seasons.services.succession import MOST_MONTHS, Copied, copy_season
from paddock.errors import UserFault
from races.web.audit_log import log
from races.web.names import named


class CopyForm(forms.Form):
    months = forms.IntegerField(
        label=gettext_lazy("Months later"),
        min_value=1,
        max_value=MOST_MONTHS,
        required=False,
        help_text=gettext_lazy("Calendar months. Empty: a year, or more where the seasons would overlap."),
    )
    name = forms.CharField(label=gettext_lazy("Name"), max_length=64, required=False)
    slug = forms.SlugField(
        label=gettext_lazy("Address"),
        max_length=50,
        required=False,
        help_text=gettext_lazy("Leave name and address empty to use this season's with the later year."),
    )


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def season_copy(request: HttpRequest, slug: str) -> HttpResponse:
    season = _season(request, slug, "league.add_season")
    form, once = CopyForm(request.POST or None), request.POST.get("once", "")
    if request.method == "POST" and form.is_valid():
        if not form_nonce.claim(once):
            return redirect("seasons")  # the copy is in the list
        with faults_shown(form, nonce=once):
            copied = copy_season(season=season, now=timezone.now(), **form.cleaned_data)
            log(racer_of(request), copied.season, ADDITION, f"Copied from {season.slug} with {copied.races} races")
            _add_copied_message(request, copied)
            return redirect(copied.season)
    context = {"season": season, "form": form, "rounds": season.rounds.count(), "once": form_nonce.new_nonce()}
    return render(request, "league/seasons/copy.html", context, status=422 if form.errors else 200)


@login_required
@require_POST
def season_continues(request: HttpRequest, slug: str) -> HttpResponse:
    """Let a season continue by itself, or stop it (``continues`` 0)."""
    season = _season(request, slug, "league.change_season")
    season = edit_season(season=season, continues=request.POST.get("continues") == "1")
    log(racer_of(request), season, CHANGE, "Continues by itself" if season.continues else "Does not continue by itself")
    messages.success(
        request,
        _("The season continues automatically: the next one is drafted 60 days ahead.")
        if season.continues
        else _("The season ends without a successor."),
    )
    return redirect(season)


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def season_delete(request: HttpRequest, slug: str) -> HttpResponse:
    """Show what can be deleted; a POST deletes the season, or the one race that ``round`` names."""
    season = _season(request, slug, "league.delete_season")
    rounds = list(season.rounds.select_related("race").order_by("race__opens_at", "number", "pk"))
    now, fault = timezone.now(), None
    if request.method == "POST":
        wanted = request.POST.get("round", "")
        one = next((one for one in rounds if str(one.pk) == wanted), None)
        try:
            if wanted and one is not None:
                delete_round(round=one, now=now)
                log(racer_of(request), season, CHANGE, f"Deleted the race {one.race.slug}")
                messages.success(request, _("%(race)s is deleted.") % {"race": named(one.race.name)})
                return redirect("season_delete", season.slug)
            if not wanted:
                with transaction.atomic():
                    log(racer_of(request), season, DELETION, f"Deleted with {len(rounds)} races")
                    delete_season(season=season, now=now)
                messages.success(request, _("%(season)s is deleted.") % {"season": named(season.name)})
                return redirect("seasons")
        except UserFault as refused:
            fault = refused
    kept = {one.pk: explain(why) for one in rounds if (why := why_kept(one.race, now)) is not None}
    context = {
        "season": season,
        "rows": [(one, kept.get(one.pk)) for one in rounds],
        "kept": next(iter(kept.values()), ""),
        "fault": None if fault is None else explain(fault),
    }
    return render(request, "league/seasons/delete.html", context, status=409 if fault else 200)


def _add_copied_message(request: HttpRequest, copied: Copied) -> None:
    text = ngettext("Season copied: %d race.", "Season copied: %d races.", copied.races) % copied.races
    messages.success(request, text)
    if copied.left_out:
        names = ", ".join(named(name) for name in copied.left_out)
        messages.warning(request, _("Not possible at their new times: %(races)s.") % {"races": names})


def _season(request: HttpRequest, slug: str, permission: str) -> Season:
    if not (request.user.is_staff and request.user.has_perm(permission)):
        raise PermissionDenied
    return get_object_or_404(Season, slug=slug)
