"""Template tags for the cars on track and the races of a group."""

from collections.abc import Iterable

from django import template
from django.template import Context
from django.template.loader import render_to_string
from django.utils.safestring import SafeString

from accounts.models import RacerGroup, Viewer
from core.streams.shared_pieces import lasting_piece, shared_piece
from races.boards.drawn_boards import drawn_row
from races.boards.selectors.shared_boards import shared_race
from races.entries.selectors.visibility import races_visible_to
from races.models import Race
from races.pages.selectors import OnTrack, on_track, track_of
from races.streams import RACES
from races.templatetags.races import race_medal, target_medal, tries_line

register = template.Library()
_TRACK_NOW = "races/pages/parts/track_now.html"


@register.simple_tag(takes_context=True)
def race_piece(context: Context, template: str, **values: str | int | None) -> SafeString:
    """A part of a page of a race that depends on nothing but the race and ``values``: drawn once for all readers."""
    slug = context["race"].slug
    key = (slug, tuple(values.items()))
    assert all(isinstance(value, str | int | None) for value in values.values()), values
    return shared_piece(template, lambda: {**values, "race": shared_race(slug)}, key=key)


@register.simple_tag(takes_context=True)
def my_line(context: Context) -> SafeString:
    """The reader's row of the board, for another page of it."""
    return drawn_row(context["board"], context["my_cut"], context["user"])


@register.simple_tag(takes_context=True)
def my_facts(context: Context) -> SafeString:
    """The facts about the reader's row beside the board of a race, and its links."""
    race, board, latest = context["race"], context["board"], context["latest"]
    row, (rival, rival_ms) = board.my_row, board.rival or (None, None)
    entry = row.entry
    target = target_medal(context, race, entry.best_lap_ms, board.rows)
    facts = {
        **{"slug": race.slug, "physical": race.physical, "state": str(context["state"]), "left": context["left"]},
        **{"has_results": context["has_results"], "alias": row.racer.alias, "rank": row.rank},
        **{"gap_ms": row.gap_ms, "interval_ms": row.interval_ms, "best_lap_ms": entry.best_lap_ms},
        **{
            "rival": rival and rival.shown_name,
            "rival_ms": rival_ms,
            "tries": tries_line(latest.tries) if latest else "",
        },
        **{
            "medal": race_medal(context, race, entry.best_lap_ms),
            "run": entry.best and entry.best.evaluation.public_id,
        },
    }
    house = target and target.house
    of_target = target and (target.medal, target.slowest_ms, target.by_ms, house and house.shown_name)
    return lasting_piece("races/boards/my_facts.html", {**facts, "target": target}, key=(*facts.values(), of_target))


@register.simple_tag(takes_context=True)
def run_piece(context: Context, template: str) -> SafeString:
    """A part of a finished run's page about the shown car: drawn once for all readers. The key has all that the parts
    are made of."""
    values = {name: context[name] for name in ("evaluation", "car", "result", "laps", "may_crash")}
    car, result = values["car"], values["result"]
    of_car = (car.number, car.result.trace_sha256, result.engine)
    key = (values["evaluation"].public_id, *of_car, bool(values["may_crash"]), repr(values["laps"]))
    return shared_piece(template, lambda: values, key=key)


@register.simple_tag(takes_context=True)
def track_now(context: Context, races: Iterable[Race] | None = None, follows: str = RACES) -> SafeString:
    """The cars on track now and next: in the page's race, in ``races``, or in all visible races. ``follows``: the topic
    that updates the part."""
    user = getattr(context.get("request"), "user", None)
    race: Race | None = context.get("race") if races is None else None
    wanted = None if races is None else [each.pk for each in races]
    of_race = None if race is None else race.pk

    def track(reader: Viewer) -> OnTrack:
        return on_track(reader, wanted) if of_race is None else track_of(of_race)

    values = {"follows": follows if of_race is None else f"race:{of_race}", "of_race": of_race is not None}
    mine = track(user)
    if mine.for_all and not mine.is_watched_by(getattr(user, "pk", None)):
        key = (values["follows"], of_race, wanted and tuple(wanted))
        return shared_piece(_TRACK_NOW, lambda: values | {"track": track(None)}, key=key)
    return render_to_string(_TRACK_NOW, values | {"track": mine, "user": user})


@register.simple_tag(takes_context=True)
def races_of_group(context: Context, group: RacerGroup) -> list[Race]:
    """Races that are held for the group alone and that the reader may see, the latest first."""
    viewer = getattr(context.get("request"), "user", None)
    return list(races_visible_to(viewer).filter(group=group).order_by("-opens_at", "-pk")[:50])
