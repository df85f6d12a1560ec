"""Data for the page of a result: lap rows with sector colours, driven lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from paddock.geometry.track import TrackGeometry
from paddock.simulator.results import LapDocument
from races.boards.selectors.board import sector_colour
from races.models import Race
from tracks.drawing.maps import MARGIN_M, TOP_SPEED_MPS, Trajectory
from tracks.models import Track

LAP_COLOURS = 6
SECTORS = 3


class ColourBy(StrEnum):
    """The meaning of a trajectory's colour."""

    SPEED = "speed"
    LAP = "lap"

    @classmethod
    def of(cls, word: str | None) -> Self:
        """The colouring that a query names; by speed unless it names another."""
        return cls.LAP if word == cls.LAP else cls.SPEED


@dataclass(frozen=True)
class LapRow:
    """A lap as its table shows it. ``gap_ms``: to the run's best lap; ``sectors``: (time in ms, colour) each."""

    lap: LapDocument
    is_best: bool
    gap_ms: int | None
    sectors: list[tuple[int, str]]

    @property
    def missing(self) -> range:
        """One for each sector that the lap has no time for."""
        return range(SECTORS - len(self.sectors))


def lap_rows(laps: Sequence[LapDocument], race: Race | None) -> list[LapRow]:
    """The laps with their sector colours: purple as fast as anybody ranked in ``race``, green the run's own best,
    yellow slower. ``race``: None without purple (:func:`races.runs.video_titles.race_of_marks`)."""
    complete = [lap for lap in laps if lap["complete"]]
    best_ms = min((lap["time_ms"] for lap in complete), default=None)
    own = [min(times) for times in zip(*(lap["sector_ms"] for lap in complete if _timed(lap)), strict=False)]
    fastest = race.fastest_sectors_ms if race is not None else (None, None, None)
    rows = []
    for lap in laps:
        counts = lap["complete"] and _timed(lap)
        sectors = [
            (time, sector_colour(time, own[index], fastest[index]) if counts else "")
            for index, time in enumerate(lap.get("sector_ms") or ())
        ]
        gap = lap["time_ms"] - best_ms if best_ms is not None and lap["complete"] else None
        rows.append(LapRow(lap, gap == 0, gap or None, sectors))
    return rows


def _timed(lap: LapDocument) -> bool:
    sectors = lap.get("sector_ms") or ()
    return len(sectors) == SECTORS and all(time is not None for time in sectors)


def speed_scale(line: Sequence[Sequence[Sequence[float]]]) -> tuple[float, float]:
    """The slowest and the fastest speed (m/s) of all laps, to one decimal; the standing start does not count."""
    speeds = [point[2] for points in line for point in points if point[2] > 0]
    return (round(min(speeds), 1), round(max(speeds), 1)) if speeds else (0.0, TOP_SPEED_MPS)


def trajectories(
    line: Sequence[Sequence[Sequence[float]]], colour: ColourBy, lap: int | None = None
) -> list[Trajectory]:
    """The driven lines of all laps (or of lap ``lap``, from 1) to draw on the map."""
    lines = []
    scale = speed_scale(line)
    for index, points in enumerate(line):
        if lap is not None and index != lap - 1:
            continue
        if colour == ColourBy.SPEED:
            lines.append(Trajectory(points, [point[2] for point in points], scale=scale))
        else:
            lines.append(Trajectory(points, style=f"lap-{index % LAP_COLOURS}"))
    return lines


def map_point(track: Track, x: float, y: float) -> tuple[float, float]:
    """A place in metres in the coordinates of the map (from its upper left corner, y down)."""
    return map_place(track.geometry, x, y)


def map_place(geometry: TrackGeometry, x: float, y: float) -> tuple[float, float]:
    """The same for a track's geometry, in either direction."""
    x_min, _, _, y_max = geometry.bounds
    return round(x - x_min + MARGIN_M, 3), round(y_max + MARGIN_M - y, 3)


def map_size(track: Track) -> tuple[float, float]:
    """Width and height of the map's coordinates."""
    x_min, y_min, x_max, y_max = track.geometry.bounds
    return round(x_max - x_min + 2 * MARGIN_M, 2), round(y_max - y_min + 2 * MARGIN_M, 2)
