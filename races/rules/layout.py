"""The boxes and bots of a race: laid out like in the simulator, checked, and marked on maps."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from django.core.exceptions import ValidationError
from django.utils.translation import gettext as _

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import BOX_COUNT, HEAD_TO_HEAD, RULES, RUN_RULES, BoxPlace, RaceRules
from paddock.simulator.layout import Layout, box_faults, lay_out, place_box
from paddock.simulator.solids import Solid, box
from tracks.drawing.maps import BoxMark
from tracks.models import Track

from ..errors import problem
from ..models import Lane, Race
from ..models.layout import FixedBox, misplaced


def race_rules(race: Race) -> RaceRules:
    """The simulator's rules for a race. Raises ValueError for a race that contradicts itself."""
    values = {name: getattr(race, name) for name in RUN_RULES if name in RULES and name != "boxes"}
    return RaceRules(**values, boxes=tuple(BoxPlace(float(one["fraction"]), one["lane"]) for one in race.boxes))


def laid_out(race: Race) -> Layout:
    """The layout of a race, boxes in the order driven. Raises UserFault as :func:`paddock.simulator.layout.lay_out`."""
    return _lay(race.track.geometry, race_rules(race))


@lru_cache(maxsize=256)
def _lay(geometry: TrackGeometry, rules: RaceRules) -> Layout:
    return lay_out(geometry.in_direction(rules.direction), rules)


def check_layout(race: Race) -> None:
    """Refuse boxes and bots without room on the track, and several cars on an open one. Raises ValidationError by
    field. The race has passed ``full_clean``."""
    if not (has_boxes(race) or race.bots or race.race_type == HEAD_TO_HEAD):
        return
    try:
        laid_out(race)
    except UserFault as fault:
        placed = "bots" if race.bots else BOX_COUNT if race.random_boxes else "boxes"
        field = "track" if fault.code == "track_needs_loop" else placed
        raise ValidationError({field: problem(fault.code, **fault.params)}) from fault


def has_boxes(race: Race) -> bool:
    """Whether the track has boxes in known places: not in an imported race."""
    return bool(race.boxes or race.random_boxes)


class BoxRow(FixedBox):
    """Where a box stands, in metres and radians."""

    x: float
    y: float
    yaw: float


def box_rows(race: Race) -> list[BoxRow]:
    """Where each box of a race stands, in the order driven."""
    return laid_out(race).to_dict()["boxes"] if has_boxes(race) else []


def box_marks(race: Race, *, numbered: bool = False) -> tuple[BoxMark, ...]:
    """The boxes of a race for its map; ``numbered`` in the order of :func:`box_rows`."""
    return layout_marks(laid_out(race), numbered=numbered) if has_boxes(race) else ()


def typed_boxes(race: Race, places: Sequence[FixedBox | None]) -> tuple[tuple[BoxMark, ...], list[str]]:
    """Boxes as typed, marked as wrong where they cannot stand, and a sentence for each reason. Numbers are those of the
    rows; a row that is None or off the lap is not drawn."""
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
    return _("Box %(number)s: %(percent)s %% of the lap, %(lane)s") % {
        "number": number,
        "percent": f"{100 * fraction:.4g}",
        "lane": Lane(lane).label,
    }


def layout_marks(layout: Layout, *, numbered: bool = False) -> tuple[BoxMark, ...]:
    return tuple(
        _mark(placed.solid, number if numbered else 0, box_title(number, placed.fraction, placed.lane))
        for number, placed in enumerate(layout.boxes, start=1)
    )


def _mark(solid: Solid, number: int, title: str) -> BoxMark:
    return BoxMark(solid.x, solid.y, solid.yaw, solid.half_length, solid.half_width, number, title)
