"""What stands on the track of a race: laid out as the simulator lays it, checked, and marked on maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from django.core.exceptions import ValidationError
from django.utils.translation import gettext as _

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, RULES, RUN_RULES, BoxPlace, RaceRules
from paddock.simulator.layout import Layout, box_faults, lay_out, place_box
from paddock.simulator.solids import Solid, box
from tracks.drawing import BoxMark

from .errors import problem
from .models import Lane
from .models.layout import misplaced

if TYPE_CHECKING:
    from tracks.models import Track

    from .models import Race


def race_rules(race: Race) -> RaceRules:
    """What the simulator is told about a race. Raises ValueError for a race that contradicts itself."""
    told = {name: getattr(race, name) for name in RUN_RULES if name in RULES and name != "boxes"}
    return RaceRules(**told, boxes=tuple(BoxPlace(float(one["fraction"]), one["lane"]) for one in race.boxes))


def laid_out(race: Race) -> Layout:
    """The layout of a race, boxes in the order driven. Raises UserFault when boxes or bots have no room, with the codes
    of :func:`paddock.simulator.layout.lay_out`."""
    return _lay(race.track.geometry, race_rules(race))


@lru_cache(maxsize=256)
def _lay(geometry: TrackGeometry, rules: RaceRules) -> Layout:
    return lay_out(geometry.in_direction(rules.direction), rules)


def check_layout(race: Race) -> None:
    """Refuse boxes and bots that have no room on the race's track, and a race of several cars on an open one. Raises
    ValidationError on the field to change.

    The race's values must make sense by themselves (``Race.full_clean``).
    """
    if not (has_boxes(race) or race.bots or race.race_type == HEAD_TO_HEAD):
        return
    try:
        laid_out(race)
    except UserFault as fault:
        field = (
            "track"
            if fault.code == "track_needs_loop"
            else "bots"
            if race.bots
            else "random_boxes"
            if race.random_boxes
            else "boxes"
        )
        raise ValidationError({field: problem(fault.code, **fault.params)}) from fault


def has_boxes(race: Race) -> bool:
    """Whether boxes stand on the track whose places are known: not those of an imported race."""
    return bool(race.boxes or race.random_boxes)


def box_rows(race: Race) -> list[dict[str, Any]]:
    """Where each box of a race stands, in the order driven: ``{"fraction", "lane", "x", "y", "yaw"}`` in metres and
    radians, drawn ones too; empty without boxes."""
    return laid_out(race).to_dict()["boxes"] if has_boxes(race) else []


def box_marks(race: Race, *, numbered: bool = False) -> tuple[BoxMark, ...]:
    """The boxes of a race for its map; ``numbered`` in the order of :func:`box_rows`."""
    if not has_boxes(race):
        return ()
    return layout_marks(laid_out(race), numbered=numbered)


def typed_boxes(race: Race, places: Sequence[Mapping[str, Any] | None]) -> tuple[tuple[BoxMark, ...], list[str]]:
    """Boxes as they are typed, each where it would stand, those that cannot stand there marked as wrong; and a
    sentence for each reason. Numbers are those of the rows; a row that is None is not drawn, nor one off the lap."""
    track = race.track.geometry.in_direction(race.direction)
    rows = [
        (number, place_box(track, float(place["fraction"]), place["lane"]))
        for number, place in enumerate(places, start=1)
        if place is not None and 0.0 <= place["fraction"] < 1.0
    ]
    wrong: dict[int, list[str]] = {}
    for number, placed in rows:
        if refused := misplaced(number, placed.fraction):
            wrong[number] = refused.messages
    for index, fault in box_faults(track, [placed for number, placed in rows]):
        if rows[index][0] in wrong and fault.code != "boxes_overlap":
            continue  # off the line by the lap's share already
        params = dict(fault.params)
        for name in ("number", "other"):  # counted among those that are drawn
            if name in params:
                params[name] = rows[int(params[name]) - 1][0]
        wrong.setdefault(rows[index][0], []).extend(problem(fault.code, **params).messages)
    marks = tuple(
        _mark(placed.solid, number, box_title(number, placed.fraction, placed.lane))._replace(wrong=number in wrong)
        for number, placed in rows
    )
    return marks, list(dict.fromkeys(sentence for each in wrong.values() for sentence in each))


def awaited_boxes(track: Track, rules: Mapping[str, Any]) -> tuple[BoxMark, ...]:
    """The boxes of an evaluation that has no result yet (``rules`` of its spec), for the map of its run."""
    layout = _lay(track.geometry, RaceRules.from_dict(rules))
    return layout_marks(layout, numbered=True)


def driven_boxes(layout: Mapping[str, Any]) -> tuple[BoxMark, ...]:
    """The boxes of a recorded layout (``Result.layout``) for the map of a run."""
    return tuple(
        _mark(box(each["x"], each["y"], each["yaw"]), number, box_title(number, each["fraction"], each["lane"]))
        for number, each in enumerate(layout.get("boxes", ()), start=1)
    )


def box_title(number: int, fraction: float, lane: str) -> str:
    """Where a box stands, in the reader's language."""
    return _("Box %(number)s: %(percent)s %% of the lap, %(lane)s") % {
        "number": number,
        "percent": f"{100 * fraction:.4g}",
        "lane": Lane(lane).label,
    }


def layout_marks(layout: Layout, *, numbered: bool = False) -> tuple[BoxMark, ...]:
    """The boxes of a layout for a map."""
    return tuple(
        _mark(placed.solid, number if numbered else 0, box_title(number, placed.fraction, placed.lane))
        for number, placed in enumerate(layout.boxes, start=1)
    )


def _mark(solid: Solid, number: int, title: str) -> BoxMark:
    return BoxMark(solid.x, solid.y, solid.yaw, solid.half_length, solid.half_width, number, title)
