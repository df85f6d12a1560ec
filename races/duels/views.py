"""The duels of a race: table or bracket, heats, and the organiser's button."""

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST, require_safe

from core.pages.faults import faults_reported
from races.duels.selectors import duels_of
from races.duels.services import draw_duels, drive_on
from races.models import Opponents, Race

from ..web.race_page import race_context
from ..web.views import organised_race, visible_race


@require_safe
def race_duels(request: HttpRequest, slug: str) -> HttpResponse:
    """The pairings of a race's duels and their results."""
    race = _with_duels(visible_race(request, slug))
    context = race_context(request, race)
    context |= {"tab": "duels", "duels": duels_of(race, request.user)}
    return render(request, "races/duels/duels.html", context)


@login_required
@require_POST
def race_draw(request: HttpRequest, slug: str) -> HttpResponse:
    """Draw the duels of a race that has closed, without waiting for the periodic task."""
    race = _with_duels(organised_race(request, slug))
    now = timezone.now()
    with faults_reported(request):
        draw_duels(race=race, now=now)
        drive_on(race=race, now=now)
        messages.success(request, _("Duels drawn. They run one after the other."))
    return redirect("race_duels", race.slug)


def _with_duels(race: Race) -> Race:
    """The race. Raises Http404 when it is of another kind."""
    if race.opponents != Opponents.MODELS:
        raise Http404
    return race
