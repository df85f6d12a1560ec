"""The first page: what is racing now, and for a racer their own cars and results."""

from collections.abc import Callable, Hashable
from datetime import datetime
from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString
from django.views.decorators.http import require_safe

from accounts.models import Viewer
from core.streams.shared_pieces import shared_piece, shared_value
from evaluation.selectors import models_of
from league.cups.selectors import cup_now, stage_of
from league.home.selectors import LOOKED_AT, first_steps, home_races, latest_runs
from races.boards.selectors.board import podiums, to_beat
from races.entries.selectors.lists import racing_now, sees_only_public, upcoming
from races.models import Race, RaceKind
from races.spoilers.selectors import spoilers_of

UPCOMING = 5
OWN = 5


@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """Open races that the reader may enter, with their podiums; the next races; my models and latest runs.

    Readers who see only public races, and their results, share the lists; what they may enter is in the keys.
    """
    now, reader = timezone.now(), request.user
    shares = not spoilers_of(request).on and sees_only_public(reader, ("open", "upcoming"), now)

    def part(name: str, values: Callable[[], dict[str, Any]], *key: Hashable) -> SafeString:
        template = f"league/home/parts/{name}.html"
        return shared_piece(template, values, key=key) if shares else render_to_string(template, values(), request)

    def read() -> list[Race]:
        return shared_value("open races", lambda: _open_races(now)) if shares else _open_races(now, reader)

    races = read()
    cards, folded = home_races(races, reader, now)
    chosen = tuple(race.pk for race in cards), tuple((race.pk, why_not) for race, why_not in folded)

    def open_races() -> dict[str, Any]:
        newest = {race.pk: race for race in (read() if shares else races)}  # newer than what was chosen from, perhaps
        shown = [newest[pk] for pk in chosen[0] if pk in newest]
        others = [(newest[pk], why_not) for pk, why_not in chosen[1] if pk in newest]
        leading = podiums(shown)
        context = {"podiums": leading, "to_beat": to_beat(leading), "is_racer": reader.is_authenticated}
        return {"races": shown, "folded": others} | context

    coming = {} if shares else {"racer": reader}
    context: dict[str, Any] = {
        "open_races": part("open_races", open_races, reader.is_authenticated, chosen),
        "upcoming": part("upcoming", lambda: {"upcoming": list(upcoming(now, **coming)[:UPCOMING])}),
        "cup": part("cup", lambda: _cup(now)),
    }
    if reader.is_authenticated:
        models = list(models_of(reader).select_related(None).only("public_id", "name", "metadata")[:OWN])
        context |= {
            "models": models,
            "runs": list(latest_runs(reader)[:OWN]),
            "steps": first_steps(reader, now),
            "league_race": next((race for race in cards if race.kind == RaceKind.LEAGUE), None),
        }
    return render(request, "league/home/home.html", context)


def _open_races(now: datetime, reader: Viewer = None) -> list[Race]:
    return list(racing_now(now, reader).select_related("track", "organiser", "group")[:LOOKED_AT])


def _cup(now: datetime) -> dict[str, Any]:
    cup = cup_now(now)
    return {} if cup is None else {"cup": cup, "stage": stage_of(cup, now)}
