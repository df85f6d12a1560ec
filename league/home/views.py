"""The first page: the leading lap, what the reader can do next, recent results, races to enter."""

from collections.abc import Callable, Hashable, Mapping
from datetime import datetime
from typing import TypedDict

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString
from django.views.decorators.http import require_safe

from accounts.models import Viewer
from core.streams.shared_pieces import filled, hole, shared_piece, shared_value
from league.cups.selectors import cup_now, stage_of
from league.home.selectors import (
    LOOKED_AT,
    first_steps,
    home_races,
    latest_runs,
    leading_lap,
    my_places,
    newest_models,
    recent_results,
)
from races.boards.selectors.board import BoardRow, podiums, to_beat
from races.entries.selectors.lists import races_in, racing_now, sees_only_public
from races.models import Entry, Race, RaceKind
from races.replays.setup import ViewedRun, document_address, scene_address, viewer_setup
from races.rules.layout import box_marks
from races.spoilers.selectors import spoilers_of

UPCOMING = 5
NO_LAP = hole("no_lap")  # in the leading part that has no lap to play


class Boards(TypedDict):
    """The races of the cards, their podiums, and the house cars to beat where nobody is on one."""

    races: list[Race]
    podiums: dict[int, list[BoardRow]]
    to_beat: dict[int, list[Entry]]


@require_safe
def home(request: HttpRequest) -> HttpResponse:
    """The leading lap, what the reader can do next, recent results, open races with their podiums, my runs and models.

    Readers who see only public races, and their results, share the lists; what they may enter is in the keys.
    """
    now, reader, spoilers = timezone.now(), request.user, spoilers_of(request)
    shares = not spoilers.on and sees_only_public(reader, ("open", "upcoming"), now)

    def part(name: str, values: Callable[[], Mapping[str, object]], *key: Hashable) -> SafeString:
        template = f"league/home/parts/{name}.html"
        return shared_piece(template, values, key=key) if shares else render_to_string(template, values(), request)

    def read() -> list[Race]:
        return shared_value("open races", lambda: _open_races(now)) if shares else _open_races(now, reader)

    races = read()
    cards, folded = home_races(races, reader, now)
    chosen = tuple(race.pk for race in cards), tuple((race.pk, why_not) for race, why_not in folded)

    def newest() -> dict[int, Race]:
        """The open races, newer than what was chosen from, perhaps."""
        return {race.pk: race for race in (read() if shares else races)}

    def boards() -> Boards:
        def read_boards() -> Boards:
            shown = [race for pk, race in newest().items() if pk in chosen[0]]
            shown.sort(key=lambda race: chosen[0].index(race.pk))
            leading = podiums(shown)
            return {"races": shown, "podiums": leading, "to_beat": to_beat(leading)}

        return shared_value(("boards of the first page", chosen[0]), read_boards) if shares else read_boards()

    drawn = boards() if not shares else None

    def open_races() -> dict[str, object]:
        known = newest()
        others = [(known[pk], why_not) for pk, why_not in chosen[1] if pk in known]
        return {"folded": others, "is_racer": reader.is_authenticated, **(drawn or boards())}

    def leading() -> dict[str, object]:
        found = drawn or boards()
        led = [race for race in found["races"] if not spoilers.hides(race)]
        lap = leading_lap(led, found["podiums"], found["to_beat"])
        if lap is None:
            return {"race": next(iter(found["races"]), None), "no_lap": NO_LAP}
        viewed = [ViewedRun(url=document_address(lap.run), lap=lap.lap["number"])]
        viewer = viewer_setup(scene_address(lap.run), viewed, quiet=True)
        return {"leading": lap, "boxes": box_marks(lap.race), "viewer": viewer}

    def results() -> dict[str, object]:
        return {"results": recent_results([race for race in newest().values() if not spoilers.hides(race)])}

    coming = {} if shares else {"racer": reader}
    stage = part("leading", leading, chosen[0])
    if NO_LAP in stage:
        own = render_to_string("league/home/parts/own_stage.html", {}, request)
        stage = own if own.strip() else filled(stage, no_lap=SafeString())
    context: dict[str, object] = {
        "leading": stage,
        "results": part("results", results),
        "open_races": part("open_races", open_races, reader.is_authenticated, chosen),
        "upcoming": part("upcoming", lambda: {"upcoming": list(races_in("upcoming", now, **coming)[:UPCOMING])}),
        "cup": part("cup", lambda: _cup(now)),
    }
    if reader.is_authenticated:
        steps = first_steps(reader, now)
        has_place = steps is None or steps.has_place
        context |= {
            "models": newest_models(reader),
            "runs": latest_runs(reader),
            "steps": steps,
            "places": my_places(reader, [race for race in cards if not spoilers.hides(race)]) if has_place else [],
            "league_race": next((race for race in cards if race.kind == RaceKind.LEAGUE), None),
            "first_race": next(iter(cards), None),
        }
    return render(request, "league/home/home.html", context)


def _open_races(now: datetime, reader: Viewer = None) -> list[Race]:
    return list(racing_now(now, reader).select_related("track", "organiser", "group")[:LOOKED_AT])


def _cup(now: datetime) -> dict[str, object]:
    cup = cup_now(now)
    return {} if cup is None else {"cup": cup, "stage": stage_of(cup, now)}
