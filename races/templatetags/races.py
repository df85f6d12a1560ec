"""Template tags on races for pages of lower rooms."""

import json
from collections.abc import Hashable, Iterable, Sequence
from functools import lru_cache
from typing import Any

from django import template
from django.template import Context
from django.template.defaulttags import CsrfTokenNode
from django.utils import timezone
from django.utils.html import escape, format_html
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop

from core.database.kept_queries import KeptQuery
from core.pages.charts import sparkline
from core.streams.shared_pieces import filled, hole, lasting_piece, lasting_value
from core.templatetags.formats import shown_age
from core.times import clock
from evaluation.models import Evaluation, TrainedModel
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import LANES
from races.boards import ranking
from races.boards.medals import MedalTarget, medal_in, medal_of_run, medal_target
from races.boards.selectors.board import BoardRow
from races.boards.selectors.counts import driven_again
from races.boards.track_figures import real_car_records
from races.entries.selectors.lists import races_on
from races.entries.selectors.offers import Learned, Offer, offers_for
from races.entries.selectors.visibility import evaluations_visible_to
from races.models import Entry, LiveEvent, Race, RaceState
from races.replays.document import box_document
from races.replays.run_maps import LAP_COLOURS, map_place
from races.replays.selectors import race_of
from races.replays.setup import address_of_scene, viewer_setup
from races.rules import descriptions
from races.rules.layout import box_marks, has_boxes, layout_marks
from races.rules.live_start import live_layout, start_m
from races.runs.shown_runs import latest_shown
from races.templatetags.spoilers import run_hidden
from tracks.drawing.maps import BoxMark, Trajectory, draw_svg
from tracks.models import Track
from tracks.templatetags.medals import medal_badge, times_of

register = template.Library()
for texts in (
    *(descriptions.layout_facts, descriptions.layout_rules, descriptions.sensor_words, descriptions.rule_figures),
    *(descriptions.fault_words, descriptions.fault_rules, descriptions.score_words, descriptions.score_name),
    *(descriptions.worth_words, descriptions.pace, descriptions.behind, ranking.laps_needed),
):
    register.filter(texts)
register.simple_tag(driven_again, name="driving_again")

RACES_ON_A_TRACK = 20
RUNS_OF_A_MODEL = 50
PLACES_ON_A_LAP = 200  # where a click on the map may put a box: half a percent apart

# Stopwatch, box, two cars: lines of a 20 x 20 picture.
ICONS = {
    "time_trial": '<circle cx="10" cy="11.5" r="6.5"/><path d="M10 11.5V7.6M8 2.4h4M10 2.4V5"/>',
    "object_avoidance": '<path d="M10 2.6 16.6 6v8L10 17.4 3.4 14V6ZM3.4 6 10 9.4 16.6 6M10 9.4v8"/>',
    "head_to_head": '<path d="M2.6 4.4 8.4 10l-5.8 5.6M10.6 4.4 16.4 10l-5.8 5.6"/>',
}
END_REASONS = {
    "laps_done": gettext_noop("all laps driven"),
    "time_up": gettext_noop("the time limit was reached"),
    "resets_used": gettext_noop("no resets left"),
    "retired": gettext_noop("removed from the track"),
}
LAP_STATUS = {
    "Lap complete": gettext_noop("complete"),
    "Off track": gettext_noop("off track"),
    "Crashed": gettext_noop("crashed"),
    "Immobilized": gettext_noop("stood still"),
    "Reversed": gettext_noop("drove backwards"),
    "Time Up": gettext_noop("time up"),
    "In progress": gettext_noop("unfinished"),
    "Pause": gettext_noop("unfinished"),
    "Prepare": gettext_noop("unfinished"),
}


@register.simple_tag(name="races_on", takes_context=True)
def races_here(context: Context, track: Track) -> list[Race]:
    """Races on a track that the reader may see: open ones first."""
    return list(races_on(track, timezone.now(), context["user"])[:RACES_ON_A_TRACK])


@register.simple_tag
def real_cars_on(track: Track) -> list[Race]:
    """Races of real cars on a track with the fastest lap of each."""
    return list(real_car_records(track))


@register.simple_tag(takes_context=True)
def races_for(context: Context, model: TrainedModel, learned: Learned | None = None) -> list[Offer]:
    """Races that take this model of the reader now, those first that are like ``learned``, its training."""
    return offers_for(model=model, racer=context["user"], now=timezone.now(), learned=learned)


@register.simple_tag(takes_context=True)
def offer_row(context: Context, template: str, each: Offer, model: TrainedModel, *, as_in: Any = None) -> SafeString:
    """A race that takes a model, drawn once for all models and readers. ``as_in``: the training to compare with."""
    race, track, run = each.race, each.race.track, each.sent and each.sent.evaluation
    values = {"as_in": bool(as_in and each.fits), "token": hole("token"), "model": hole("model")}
    of_race = race.slug, race.name, race.race_type, race.direction, each.fits
    key = (*of_race, track.name, track.is_open, track.direction, values["as_in"], run and (run.public_id, run.state))
    row = lasting_piece(template, {"each": each, **values}, key=key)
    return filled(row, token=mark_safe(CsrfTokenNode().render(context)), model=escape(model.public_id))


@register.simple_tag(takes_context=True)
def runs_of(context: Context, model: TrainedModel) -> list[Evaluation]:
    """The latest evaluations of a model visible to the reader: of other racers' models those on boards."""
    reader = context["user"]

    if reader.pk == model.owner_id:
        runs = _all_runs(model=model.pk)
        if all(run.owner_id == reader.pk for run in runs):  # by far the most; the check in SQL is costly
            return runs
    return list(latest_shown(evaluations_visible_to(reader).filter(model_id=model.pk), RUNS_OF_A_MODEL))


_all_runs = KeptQuery(lambda model: latest_shown(Evaluation.objects.filter(model_id=model), RUNS_OF_A_MODEL))


@register.simple_tag(takes_context=True)
def run_row(context: Context, run: Evaluation, *, compact: bool = False) -> SafeString:
    """A row of the table of runs, drawn once for the same values."""
    hides, race, result = run_hidden(context, run), race_of(run), getattr(run, "result", None)
    values = {"compact": bool(compact), "hides": hides, "worth": descriptions.worth_words(run)}
    of_run = run.public_id, race and race.name, run.track.name, run.state, run.reason_code, repr(run.reason_params)
    of_result = result and (result.complete_laps, result.off_tracks)
    key = (*of_run, of_result, run.queued_at, shown_age(run.queued_at), *values.values())
    return lasting_piece("races/runs/row.html", {"run": run, **values}, key=key)


@register.simple_tag
def state_of(race: Race) -> RaceState:
    return race.state_at(timezone.now())


@register.simple_tag
def race_pill(race: Race) -> SafeString:
    """The race's state now as a pill."""
    state = state_of(race)
    return format_html('<span class="pill {}">{}</span>', state.value, state.label)


@register.simple_tag
def type_icon(race_type: str) -> SafeString:
    """A small picture of a type of race; its name stands beside it."""
    return format_html(
        '<svg class="type-icon" viewBox="0 0 20 20" aria-hidden="true">{}</svg>', mark_safe(ICONS[race_type])
    )


@register.simple_tag
def race_map(race: Race, *, numbered: bool = False) -> SafeString:
    """The map of a race: its track in the direction driven, with its boxes."""
    if not race.track.has_shape:
        return format_html('<p class="muted">{}</p>', _("No map available for this track."))
    return _map(race.track.geometry, race.direction, race.track.name, box_marks(race, numbered=numbered), False)


@register.simple_tag
def live_map(event: LiveEvent) -> SafeString:
    """The map of a live event: its boxes, and the line where its laps begin and end."""
    race, begins_m = event.race, start_m(event)
    if not race.track.has_shape:
        return race_map(race)
    boxes = layout_marks(live_layout(event)) if has_boxes(race) else ()
    return _map(race.track.geometry, race.direction, race.track.name, boxes, False, begins_m)


@register.simple_tag
def live_viewer(event: LiveEvent) -> str:
    """The setup of the viewer of a live event: its track, its boxes, and where its laps begin."""
    race = event.race
    boxes = live_layout(event).to_dict()["boxes"] if has_boxes(race) else []
    scene = address_of_scene(race.track, race.direction)
    return viewer_setup(scene, [], boxes=[box_document(box) for box in boxes], begins=start_m(event))


@register.simple_tag
def layout_map(track: Track, direction: str, boxes: tuple[BoxMark, ...], lanes: bool = False) -> SafeString:
    """The map of a layout: a track with boxes, and its two lanes in forms."""
    return _map(track.geometry, direction, track.name, boxes, lanes)


@register.simple_tag
def lane_places(race: Race) -> str:
    """Where boxes may be put on the map, as JSON: for each lane evenly spaced points along the lap."""
    return _lane_places(race.track.geometry, race.direction)


@lru_cache(maxsize=64)
def _lane_places(geometry: TrackGeometry, direction: str) -> str:
    track = geometry.in_direction(direction)
    metres = [track.length * number / PLACES_ON_A_LAP for number in range(PLACES_ON_A_LAP)]
    places = {lane: [map_place(geometry, *track.lane_centre(at, lane)[:2]) for at in metres] for lane in LANES}
    return json.dumps(places, separators=(",", ":"))


@register.simple_tag
def run_map(
    track: Track, direction: str, lines: Sequence[Trajectory], boxes: tuple[BoxMark, ...], key: Hashable = None
) -> SafeString:
    """The map of a run with the lines of its cars and its boxes. ``key``: names the run and the lines; with it the map
    is drawn once for all readers."""

    def draw() -> SafeString:
        drawing = draw_svg(track.geometry.in_direction(direction), title=track.name, lines=lines, boxes=boxes)
        return mark_safe(drawing)  # the only texts in it are titles, which draw_svg escapes

    return draw() if key is None else lasting_value(("run map", track.name, direction, key), draw)


@lru_cache(maxsize=256)
def _map(
    geometry: TrackGeometry, direction: str, title: str, boxes: tuple[BoxMark, ...], lanes: bool, line_m: float = 0.0
) -> SafeString:
    drawing = draw_svg(geometry.in_direction(direction), title=title, boxes=boxes, lanes=lanes, line_m=line_m)
    return mark_safe(drawing)  # the only texts in it are titles, which draw_svg escapes


@register.filter
def score_figure(race: Race) -> str:
    return ranking.rule_for(race).figure


@register.filter
def score_columns(race: Race) -> tuple[ranking.Column, ...]:
    return ranking.rule_for(race).columns(race)


@register.simple_tag
def time_cells(race: Race, row: BoardRow) -> SafeString:
    """The cells of a row in these columns: the most frequent part of a board, so written here and not by a template."""
    cells = []
    for column in ranking.rule_for(race).columns(race):
        fastest = row.has_fastest_lap and column.figure == "best_lap_ms"
        shown = " time" if column.ranks else f" {column.shown}" if column.shown else ""
        hidden_label = f'<span class="hidden"> ({escape(_("fastest lap"))})</span>' if fastest else ""
        time = clock(getattr(row.entry, column.figure))
        label = f' data-label="{escape(column.label)}"' if column.shown else ""
        cells.append(f'<td class="num{shown}{" best strong" if fastest else ""}"{label}>{time}{hidden_label}</td>')
    return mark_safe("".join(cells))  # words of ours, and times


@register.filter
def figure_in(shown: ranking.Standing, column: ranking.Column) -> int | None:
    """The time of a standing in a column."""
    figure: int | None = getattr(shown, column.figure)
    return figure


@register.simple_tag
def tries_line(scores: Sequence[int]) -> SafeString:
    """A racer's scores in a race as a small line; nothing for less than two."""
    if len(scores) < 2:
        return mark_safe("")
    return mark_safe(sparkline(scores, " · ".join(map(clock, scores))))  # times only


@register.simple_tag(takes_context=True)
def race_medal(context: Context, race: Race, best_lap_ms: int | None) -> SafeString | str:
    """The medal of a best lap in a race."""
    return medal_badge(None if best_lap_ms is None else medal_in(race, best_lap_ms, times_of(context)))


@register.simple_tag(takes_context=True)
def run_medal(context: Context, run: Evaluation) -> SafeString | str:
    """The medal of a finished run."""
    return medal_badge(medal_of_run(run, times_of(context)))


@register.simple_tag(takes_context=True)
def target_medal(
    context: Context, race: Race, best_lap_ms: int | None, cars: Iterable[BoardRow | Entry]
) -> MedalTarget | None:
    """The next medal for a lap (None: no lap yet), with the house cars among the rows or entries."""
    house = [car.entry if isinstance(car, BoardRow) else car for car in cars if car.is_baseline]
    return medal_target(race, best_lap_ms, house, times_of(context))


@register.simple_tag(takes_context=True)
def house_target(context: Context, race: Race, car: Entry) -> MedalTarget | None:
    """The next medal beyond the lap of a house car; None where that has the best."""
    return None if car.best_lap_ms is None else medal_target(race, car.best_lap_ms, [car], times_of(context))


@register.filter
def end_reason(code: str) -> str:
    return _(END_REASONS[code]) if code in END_REASONS else code


@register.filter
def lap_status(status: str) -> str:
    return _(LAP_STATUS[status]) if status in LAP_STATUS else status


@register.filter
def tens(percent: int) -> int:
    """Rounded down to tens, for screen readers."""
    return int(percent) // 10 * 10


@register.filter
def lap_colour(number: int) -> int:
    """Which of the lap colours lap ``number`` (from 1) has."""
    return (number - 1) % LAP_COLOURS


@register.filter
def overall_percent(progress: dict) -> int:
    """How much of a whole run is driven, from the progress within its lap."""
    if not progress or not progress.get("laps"):
        return 0
    driven = 100 * (progress["lap"] - 1) + min(100.0, max(0.0, progress["percent"]))
    return round(driven / progress["laps"])


@register.filter
def sector_word(colour: str | None) -> str:
    """The meaning of a sector's colour, for screen readers."""
    words = {"purple": _("fastest of all racers"), "green": _("personal best"), "yellow": _("slower")}
    return words.get(colour or "", "")
