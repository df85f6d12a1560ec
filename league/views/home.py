"""The first page: what is racing now, and for a racer their own cars and results."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from evaluation.models import Evaluation
from evaluation.selectors import models_of
from league.selectors.cups import cup_now, stage_of
from league.selectors.home import home_races
from league.selectors.steps import first_steps, league_race_now
from races.engines import hidden_runs
from races.selectors import podiums, racing_now, to_beat, upcoming

UPCOMING = 5
OWN = 5


@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """Open races that the reader may enter, with their podiums; the next races; my models and latest runs."""
    now = timezone.now()
    shown = home_races(racing_now(now, request.user), request.user, now)
    leading = podiums(shown.cards)
    context: dict[str, Any] = {
        "races": shown.cards,
        "folded": shown.folded,
        "podiums": leading,
        "to_beat": to_beat(leading),
        "upcoming": list(upcoming(now, request.user)[:UPCOMING]),
    }
    if (cup := cup_now(now)) is not None:
        context |= {"cup": cup, "stage": stage_of(cup, now)}
    if request.user.is_authenticated:
        related = ("model", "track", "result", "submission__entry__race", "duel__race")
        mine = Evaluation.objects.filter(~hidden_runs(), owner=request.user, replaced_by=None)
        mine = mine.select_related(*related).order_by("-queued_at")
        context |= {
            "models": list(models_of(request.user)[:OWN]),
            "runs": list(mine[:OWN]),
            "steps": first_steps(request.user, now),
            "league_race": league_race_now(shown.cards),
        }
    return render(request, "league/home.html", context)
