"""The colours of the site's dark pages (static/css/base.css, board.css, race.css) as BGR."""

import re

from evaluation.appearance.looks import COLOUR, DEFAULT_COLOUR
from tracks.drawing.maps import SPEED_CLASSES, TOP_SPEED_MPS

Colour = tuple[int, int, int]


def bgr(colour: str) -> Colour:
    """A colour ``#rrggbb`` as BGR; the default for anything else."""
    written = str(colour).lower()
    if not re.match(COLOUR, written):
        written = DEFAULT_COLOUR
    red, green, blue = bytes.fromhex(written[1:7])
    return blue, green, red


def mixed(one: Colour, other: Colour, share: float) -> Colour:
    """``one`` with a share (0 to 1) of ``other``."""
    return tuple(round(a + (b - a) * share) for a, b in zip(one, other, strict=True))  # type: ignore[return-value]


GROUND, SURFACE, SUNKEN = bgr("#0c0f14"), bgr("#151a21"), bgr("#10141a")
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
SPEEDS = tuple(map(bgr, ("#e5484d", "#f2803a", "#f2c53d", "#9ccc3c", "#2fbf71", "#2cc9dd")))


def speed_class(speed: float) -> int:
    """The index in :data:`SPEEDS` of a speed (m/s)."""
    return min(max(int(speed / TOP_SPEED_MPS * SPEED_CLASSES), 0), SPEED_CLASSES - 1)
