"""Computes how much tape a track needs."""

from dataclasses import dataclass

import numpy as np

from ..checks import Points
from ..markings import Markings

OUTER, INNER, BORDER, ACROSS, DASHED = "outer", "inner", "border", "across", "dashes"


@dataclass(frozen=True)
class Line:
    """The tape of one line. ``metres``: of all pieces; ``kind``: a word of this module."""

    kind: str
    metres: float
    pieces: int
    width_mm: float


def bill_of_tape(marks: Markings) -> list[Line]:
    """Every line of a track, measured along the middle of its tape; the border of an open road is one line."""
    style = marks.style
    kinds = (BORDER,) if len(marks.tapes) == 1 else (OUTER, INNER)
    tapes = sorted((_length(tape) for tape in marks.tapes), reverse=True)
    width = style.line_width * 1000
    lines = [Line(kind, metres, 1, width) for kind, metres in zip(kinds, tapes, strict=True)]
    if len(marks.across):
        metres = sum(float(np.linalg.norm(line[2] - line[1])) for line in marks.across)
        lines.append(Line(ACROSS, metres, len(marks.across), width))
    count = len(marks.dashes)
    return [*lines, Line(DASHED, count * style.dash_length, count, style.dash_width * 1000)]


def _length(line: Points) -> float:
    return float(np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1).sum())
