"""The drawings of the shells as SVG path data (``static/viewer/shells.json``, which the viewer reads too).

From the side, as pages show a car: 120 x 56 units, driving to the right. From above, as a replay shows it: 120 x 68
units around the middle of the car, driving to the right. A car is 0.33 m long, so that a unit is about 3 mm.
"""

import json
from dataclasses import dataclass
from pathlib import Path

GROUND = 50.0
_COVERED = "M-38-31H-20V31H-38ZM20-31H38V31H20Z"  # wheels under a body, of which the edges show


@dataclass(frozen=True)
class FromTheSide:
    """One shell from the side. ``wheels``: x of both axles, and the radius."""

    body: str
    glass: str = ""
    dark: str = ""
    wheels: tuple[float, float, float] = (28.0, 92.0, 10.0)


@dataclass(frozen=True)
class FromAbove:
    """One shell from above. ``under``: wheels and other parts below the body; ``dark``: dark parts on top of it."""

    body: str
    glass: str = ""
    dark: str = ""
    under: str = _COVERED


_FILE = Path(__file__).resolve().parents[2] / "static" / "viewer" / "shells.json"
_DRAWINGS = json.loads(_FILE.read_text("utf-8"))
FROM_THE_SIDE = {shell: FromTheSide(**drawings["side"]) for shell, drawings in _DRAWINGS.items()}
FROM_ABOVE = {shell: FromAbove(**drawings["above"]) for shell, drawings in _DRAWINGS.items()}
