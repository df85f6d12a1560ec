"""Places boxes and bots on a track, at fixed places or drawn from the race's seed."""

# Every draw comes from :class:`random.Random`, seeded with a text, by its ``random()`` alone: Python guarantees that
# this sequence is the same in every version and on every machine, numpy does not.

import math
import random
from collections.abc import Iterator, Sequence
from typing import Annotated, NamedTuple, NotRequired, TypedDict

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, INNER, LANES, OUTER, RaceRules

from .solids import BOX_HALF_WIDTH_M, Solid, box

START_CLEAR_M = 1.0  # no box nearer to the finish line than this, before and after it
RANDOM_START_CLEAR_M = 2.0  # a drawn box leaves a car that starts this much to get moving (min distance of simapp)
BOX_SPACING_M = 1.0  # least distance between two boxes along the centre line: a lane change at full lock takes 0.97 m
BOX_APART_M = 0.65  # least distance between two boxes over the field: nearer, their judged rectangles may overlap
PASSAGE_M = 0.18  # what a box leaves free of the road beside it: a car's wheels are 0.16 m apart

BOTS_START_M, BOTS_END_M = 2.5, 2.9  # no bot starts nearer to the line than this, after and before it (start grid)
BOT_SPACING_M = 2.0  # deepracer-simapp, MIN_DISTANCE_BETWEEN_BOT_CARS

_ATTEMPTS = 100  # layouts drawn until one has room for every box
_ROUNDING_M = 1e-4  # of a drawn fraction, on the longest track


class PlacedBox(NamedTuple):
    """A box on a track: the share of the lap and the metres from the finish line, its lane and its block."""

    fraction: float
    lane: str
    metres: float
    solid: Solid


class BoxDocument(TypedDict):
    """A box of a layout in JSON, in metres and radians to a thousandth."""

    fraction: float
    lane: Annotated[str, LANES]
    x: float
    y: float
    yaw: float


class LayoutDocument(TypedDict):
    """A layout in JSON. ``bots``: for each bot x, y and yaw at every step of the first car."""

    boxes: list[BoxDocument]
    bots: NotRequired[list[list[tuple[float, float, float]]]]


class Layout(NamedTuple):
    """The boxes on the track, in driving order."""

    boxes: tuple[PlacedBox, ...] = ()

    def to_dict(self) -> LayoutDocument:
        return {
            "boxes": [
                {
                    "fraction": round(box.fraction, 6),
                    "lane": box.lane,
                    "x": round(box.solid.x, 3),
                    "y": round(box.solid.y, 3),
                    "yaw": round(box.solid.yaw, 3),
                }
                for box in self.boxes
            ]
        }


EMPTY = Layout()


def lay_out(track: TrackGeometry, rules: RaceRules) -> Layout:
    """The layout of a race on ``track``, which is already in the driven direction; the same for every entrant.

    Boxes stand in the middle of their lanes, square to the track. Raises UserFault as :func:`box_faults` for fixed
    places, ``boxes_do_not_fit``, ``bots_do_not_fit``, ``track_needs_loop`` and ``track_start_fixed``.
    """
    if rules.start_m and track.is_open:
        raise UserFault("track_start_fixed")
    if rules.race_type == HEAD_TO_HEAD:
        refuse_open(track)
    if rules.bots:
        start_places(track.length, rules.bots)
    if rules.boxes:
        boxes = [place_box(track, place.fraction, place.lane) for place in rules.boxes]
        for _, fault in box_faults(track, boxes):
            raise fault
    elif rules.random_boxes:
        boxes = _draw_boxes(track, rules)
    else:
        return EMPTY
    return Layout(tuple(sorted(boxes, key=lambda box: box.metres)))


def refuse_open(track: TrackGeometry) -> None:
    """Raises UserFault ``track_needs_loop``: several cars, bots among them, drive on after the finish line."""
    if track.is_open:
        raise UserFault("track_needs_loop")


def place_box(track: TrackGeometry, fraction: float, lane: str) -> PlacedBox:
    """A box at a share of the lap in the middle of a lane."""
    metres = fraction * track.length
    return PlacedBox(fraction, lane, metres, box(*track.lane_centre(metres, lane)))


def start_places(length: float, bots: int) -> list[float]:
    """Metres after the finish line at which bots start, evenly around the track. Raises UserFault
    ``bots_do_not_fit``."""
    room = length - BOTS_START_M - BOTS_END_M
    spacing = max(room / bots, BOT_SPACING_M)  # on a short track as near as they may, with the rest of it behind them
    if (bots - 1) * spacing > room:
        raise UserFault("bots_do_not_fit", bots=bots, length_m=round(length, 2), least_m=BOT_SPACING_M)
    return [BOTS_START_M + number * spacing for number in range(bots)]


def box_faults(track: TrackGeometry, boxes: Sequence[PlacedBox]) -> Iterator[tuple[int, UserFault]]:
    """The faults of boxes in fixed places, each with the index of its box; of two boxes too near each other the later
    one. Messages count boxes from 1."""
    for number, placed in enumerate(boxes, 1):
        if min(placed.metres, track.length - placed.metres) < START_CLEAR_M:
            yield number - 1, UserFault("box_on_start_line", number=number, least_m=START_CLEAR_M)
        if not _passable(track, placed):
            width = round(track.width_at(placed.metres), 2)
            yield number - 1, UserFault("box_off_track", number=number, width_m=width)
        for other, before in enumerate(boxes[: number - 1], 1):
            along, apart = _distances(track, before, placed)
            if along < BOX_SPACING_M or apart < BOX_APART_M:
                yield number - 1, UserFault("boxes_overlap", number=other, other=number, least_m=BOX_SPACING_M)


def _passable(track: TrackGeometry, placed: PlacedBox) -> bool:
    """True where the box stands on the road and leaves room for a car beside it."""
    left, right = track.half_widths_at(placed.metres)
    on_the_left = (placed.lane == INNER) == (track.direction == "ccw")
    own, other = (left, right) if on_the_left else (right, left)
    free = other + own / 2 - BOX_HALF_WIDTH_M
    return free >= PASSAGE_M and track.on_road(placed.solid.x, placed.solid.y)


def _distances(track: TrackGeometry, a: PlacedBox, b: PlacedBox) -> tuple[float, float]:
    """Metres between two boxes along the centre line and over the field."""
    along = abs(a.metres - b.metres)
    if not track.is_open:
        along = min(along, track.length - along)
    return along, math.hypot(a.solid.x - b.solid.x, a.solid.y - b.solid.y)


def _draw_boxes(track: TrackGeometry, rules: RaceRules) -> list[PlacedBox]:
    """Boxes drawn from the seed: every layout that keeps the distances along the track is as likely as any other."""
    length, count = track.length, rules.random_boxes
    gap = max(rules.box_distance_m, BOX_SPACING_M) + _ROUNDING_M
    first, last = RANDOM_START_CLEAR_M, length - START_CLEAR_M - _ROUNDING_M
    # The distance holds across the finish line of a loop too: first and last box lie within a lap less one gap.
    span = last - first if track.is_open else min(last - first, length - gap)
    slack = span - (count - 1) * gap
    if slack >= 0:
        draw = random.Random(f"boxes {rules.seed}").random
        for _ in range(_ATTEMPTS):
            start = first + draw() * (last - first - span)
            shares = sorted(draw() for _ in range(count))
            lanes = [LANES[int(2 * draw())] for _ in range(count)]
            fractions = [
                round((start + share * slack + number * gap) / length, 6) for number, share in enumerate(shares)
            ]
            boxes = [place_box(track, fraction, lane) for fraction, lane in zip(fractions, lanes, strict=True)]
            if any(box_faults(track, boxes)):  # a stretch too narrow, or another part of the track alongside
                continue
            return boxes
    raise UserFault("boxes_do_not_fit", boxes=count, distance_m=rules.box_distance_m, length_m=round(length, 2))


def other_lane(lane: str) -> str:
    return INNER if lane == OUTER else OUTER
