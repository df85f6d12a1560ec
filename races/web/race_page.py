"""The head of a race's pages and its submission form, extended by features above."""

from collections.abc import Callable
from typing import Any

from django.db.models import Exists, OuterRef, QuerySet
from django.http import HttpRequest
from django.utils import timezone

from core.database.kept_queries import KeptQuery
from core.forms import explain
from core.streams.shared_pieces import shared_piece
from evaluation.selectors import garage_of

from ..boards.ranking import rule_for
from ..boards.selectors.shared_boards import shared_race
from ..entries.eligibility import refusal
from ..entries.selectors.lists import entry_of
from ..entries.selectors.visibility import can_organise
from ..entries.terms import has_accepted
from ..models import Entry, Race, RaceState, Submission
from ..models.sensors import not_offered

Part = Callable[[HttpRequest, Race, Entry | None], dict[str, object]]
PARTS: list[Part] = []  # of features above: each adds its values to the context of every page of a race
NO_ENTRY = 0  # no row has this id


def race_context(request: HttpRequest, shown: Race, entry: Entry | None = None, *, looked_up: bool = False) -> dict:
    """The context of a race's head and submission form. ``entry``: the reader's, if it was ``looked_up`` already."""
    now = timezone.now()
    state = shown.state_at(now)
    entry = entry if looked_up else entry_of(shown, request.user)
    limit = shown.max_submissions
    left = None if limit is None else limit - (entry.submission_count if entry else 0)
    context: dict[str, object] = {
        "race": shown,
        "state": state,
        "entry": entry,
        "is_entered": entry is not None,
        "hero": shared_piece("races/web/hero.html", lambda: _hero(shown.slug), key=(shown.slug, state)),
        "can_organise": can_organise(request.user, shown),
        "left": left,
        "used_up": left is not None and left <= 0,
    }
    for part in PARTS:
        context |= part(request, shown, entry)
    if request.user.is_authenticated and state in (RaceState.OPEN, RaceState.UPCOMING):
        context["asks_terms"] = not has_accepted(entry, shown)
        fault = refusal(shown, request.user, now)
        context["not_for_me"] = fault and explain(fault)
    if shown.physical and entry is not None:
        context["models"] = _garage(racer=request.user.pk, entry=entry.pk)
    elif state == RaceState.OPEN and request.user.is_authenticated and not shown.physical:
        garage = _garage(racer=request.user.pk, entry=entry.pk if entry else NO_ENTRY)
        fitting = [model for model in garage if not not_offered(model.sensors, shown.sensors)]
        context |= {
            "models": [model for model in fitting if not model.is_sent],
            "all_sent": bool(fitting),
            "garage_is_empty": not garage,
        }
    context["can_send"] = bool(context.get("models")) and not context["used_up"]
    return context


def _hero(slug: str) -> dict[str, object]:
    race = shared_race(slug)
    return {"race": race, "state": race.state_at(timezone.now()), "ranking_rule": rule_for(race).rule(race)}


def _models(racer: Any, entry: Any) -> QuerySet[Any]:
    """A garage, and whether the entry has sent a model's network: the same car would only drive the same laps again."""
    sent = Submission.objects.filter(entry_id=entry, is_void=False, network_id=OuterRef("network_id")).order_by()
    garage = garage_of(racer).select_related(None).only("public_id", "name", "metadata")
    return garage.annotate(is_sent=Exists(sent))


_garage: KeptQuery[Any] = KeptQuery(_models)
