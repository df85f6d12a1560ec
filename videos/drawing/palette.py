"""The colours of the picture: those of the site's dark pages (static/css/base.css, board.css, race.css), as BGR."""

from __future__ import annotations

import re

from evaluation.looks import COLOUR, DEFAULT_COLOUR
from tracks.drawing.png import SCHEMES
from tracks.drawing.trajectories import SPEED_CLASSES, TOP_SPEED_MPS

Colour = tuple[int, int, int]


def bgr(colour: str) -> Colour:
    """A colour ``#rrggbb`` as OpenCV has it; Paddock's own for what is none."""
    written = str(colour).lower()
    if not re.match(COLOUR, written):
        written = DEFAULT_COLOUR
    red, green, blue = bytes.fromhex(written[1:7])
    return blue, green, red


def mixed(one: Colour, other: Colour, share: float) -> Colour:
    """``one`` with a share of ``other`` in it, 0 to 1."""
    return tuple(round(a + (b - a) * share) for a, b in zip(one, other, strict=True))  # type: ignore[return-value]


GROUND, SURFACE, RAISED, SUNKEN = bgr("#0c0f14"), bgr("#151a21"), bgr("#1a2029"), bgr("#10141a")
LINE, LINE_STRONG = bgr("#262d37"), bgr("#3a4350")
TEXT, SOFT, MUTED = bgr("#eef1f5"), bgr("#c2c9d3"), bgr("#919ba8")
ACCENT = bgr("#ff3b55")
ROAD, ROAD_LINE, VERGE = bgr("#2a313b"), bgr("#77828f"), bgr("#12171e")
GRID = bgr("#171c24")
KERB_RED, KERB_WHITE = bgr("#a8283c"), bgr("#aab2bd")
BOX, BOX_LINE = bgr("#d99a3d"), bgr("#5e3d0c")
BOT, BOT_BODY = bgr("#5eb0ff"), bgr("#27445f")
TYRE, GLASS = bgr("#10151b"), bgr("#9db7cf")
SECTORS = {"purple": bgr("#ab66ff"), "green": bgr("#34d17f"), "yellow": bgr("#f2bf45")}
SPEEDS = tuple(bgr(colour) for colour in SCHEMES["dark"].speeds)


def speed_class(speed: float) -> int:
    """Which of the map's ``SPEED_CLASSES`` colours a speed (m/s) has."""
    return min(max(int(speed / TOP_SPEED_MPS * SPEED_CLASSES), 0), SPEED_CLASSES - 1)
