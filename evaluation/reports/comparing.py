"""Two reports side by side: what both drove, and how they differ."""

from __future__ import annotations

from dataclasses import dataclass

from paddock.rules.report import KINDS

from .grading import KindSummary
from .models import CarReport, ReportLap
from .selectors import ReportFigures


@dataclass(frozen=True)
class KindPair:
    """A kind of variation in both; ``kind`` is empty for all of them."""

    kind: str
    mine: KindSummary
    other: KindSummary


@dataclass(frozen=True)
class LapPair:
    """A lap that both drove. ``gap_ms``: by how much the other was slower, None where one did not come round."""

    mine: ReportLap
    other: ReportLap

    @property
    def gap_ms(self) -> int | None:
        if not (self.mine.complete and self.other.complete):
            return None
        return (self.other.time_ms or 0) - (self.mine.time_ms or 0)


@dataclass(frozen=True)
class Compared:
    """``same_variations``: whether both drove the very same ones."""

    other: CarReport
    kinds: list[KindPair]
    laps: list[LapPair]
    same_variations: bool


def compared(mine: CarReport, figures: ReportFigures, other: CarReport, others: ReportFigures) -> Compared:
    """What two finished reports have in common."""
    one, two = figures.robustness, others.robustness
    kinds = []
    if one is not None and two is not None:
        kinds = [KindPair("", one.overall, two.overall)]
        kinds += [KindPair(kind, a, b) for kind, a, b in zip(KINDS, one.kinds, two.kinds, strict=True)]
    theirs = {(lap.track_id, lap.direction): lap for row in others.tracks for lap in row.laps}
    laps = [
        LapPair(lap, theirs[lap.track_id, lap.direction])
        for row in figures.tracks
        for lap in row.laps
        if (lap.track_id, lap.direction) in theirs
    ]
    same = (mine.variations_on_id, mine.direction, mine.seed) == (other.variations_on_id, other.direction, other.seed)
    return Compared(other, kinds, laps, same)
