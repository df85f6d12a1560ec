"""The pictures of a report as plain shapes, which a template writes as SVG: no script, and the page's own colours."""

from collections.abc import Sequence
from dataclasses import dataclass

from paddock.rules.report import EACH, KINDS, kind_of, percent_of
from tracks.drawing.maps import MARGIN_M
from tracks.models import Track

from ..models.reports import ReportLap

CELL, LEFT, ROW = 16, 96, 26  # of the strip of variations, in the picture's units
WIDTH = LEFT + EACH * CELL


@dataclass(frozen=True)
class Cell:
    """One variation in the strip: ``x`` from the left."""

    x: int
    complete: bool
    percent: int
    reached: float


@dataclass(frozen=True)
class Dot:
    x: float
    time_ms: int


@dataclass(frozen=True)
class KindRow:
    """One kind of variation: its cells from mild to strong, and the times of its completed laps."""

    kind: str
    y: int
    cells: list[Cell]
    dots: list[Dot]


@dataclass(frozen=True)
class VariationPicture:
    """Two drawings of the same rows: the cells, and the completed laps on a line of times from ``left``; ``ticks``: its
    ends."""

    width: int
    height: int
    left: int
    rows: list[KindRow]
    ticks: list[Dot]


@dataclass(frozen=True)
class Cross:
    """Where a lap under a variation ended, on the track's map."""

    x: float
    y: float
    kind: str
    percent: int
    reached: float


def variation_picture(laps: Sequence[ReportLap]) -> VariationPicture:
    times = [lap.time_ms or 0 for lap in laps if lap.complete]
    least, most = (min(times), max(times)) if times else (0, 0)
    span = max(most - least, 1)

    def place(time_ms: int) -> float:
        return round(LEFT + 6 + (WIDTH - LEFT - 12) * (time_ms - least) / span, 1)

    rows = []
    for number, kind in enumerate(KINDS):
        mine = [lap for lap in laps if kind_of(lap.variation or 0) == kind]
        cells = [
            Cell(
                LEFT + ((lap.variation or 0) % EACH) * CELL,
                bool(lap.complete),
                percent_of(lap.variation or 0),
                lap.percent or 0.0,
            )
            for lap in mine
        ]
        dots = [Dot(place(lap.time_ms or 0), lap.time_ms or 0) for lap in mine if lap.complete]
        rows.append(KindRow(kind, 24 + number * ROW, cells, dots))
    ends = sorted({least, most}) if times else []
    ticks = [Dot(place(time_ms), time_ms) for time_ms in ends]
    return VariationPicture(WIDTH, 24 + len(KINDS) * ROW + 20, LEFT, rows, ticks)


def crosses(track: Track, laps: Sequence[ReportLap]) -> list[Cross]:
    """Where laps under variations ended that were not completed, in the coordinates of the track's map."""
    x_min, _, _, y_max = track.geometry.bounds
    return [
        Cross(
            round((lap.x or 0.0) - x_min + MARGIN_M, 3),
            round(y_max + MARGIN_M - (lap.y or 0.0), 3),
            kind_of(lap.variation or 0),
            percent_of(lap.variation or 0),
            lap.percent or 0.0,
        )
        for lap in laps
        if lap.complete is False
    ]


def map_box(track: Track) -> tuple[float, float]:
    x_min, y_min, x_max, y_max = track.geometry.bounds
    return round(x_max - x_min + 2 * MARGIN_M, 2), round(y_max - y_min + 2 * MARGIN_M, 2)
