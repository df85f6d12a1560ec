"""The dozen shells that a vehicle may wear: side views drawn for Paddock, 120 x 56 units, driving to the right.

Each is (body, glass, extras): paths of the body in the vehicle's colour, of the windows, and of dark parts. Wheels come
from :data:`WHEELS`: (x of the rear, x of the front, radius).
"""

from __future__ import annotations

from dataclasses import dataclass

from .models.choices import Shell

GROUND = 50.0


@dataclass(frozen=True)
class Drawing:
    """One shell. ``body``, ``glass``, ``dark``: SVG path data; ``wheels``: x of both axles and the radius."""

    body: str
    glass: str = ""
    dark: str = ""
    wheels: tuple[float, float, float] = (28.0, 92.0, 10.0)


DRAWINGS: dict[str, Drawing] = {
    # the car of this house: a low nose, a camera mast, a slanted tail as in the mark
    Shell.PADDOCK: Drawing(
        body="M8 42 14 27Q15 24 19 24H40L54 16Q57 14 61 14H76Q80 14 83 16L94 25 110 30Q115 32 115 37V42Z",
        glass="M46 24 57 18H74L84 25Z",
        dark="M62 14V6H72V11H66V14ZM8 42H115V45H8Z",
    ),
    Shell.FORMULA: Drawing(
        body="M12 34 18 24H40L46 16Q48 14 51 15L60 22 74 25 108 35Q114 37 114 40H104L18 41Z",
        glass="M52 22 58 18 66 24Z",
        dark="M4 14H22V18H16L18 26H14L10 18H4ZM100 42H119V45H100ZM20 41H104V44H20Z",
        wheels=(26.0, 94.0, 11.0),
    ),
    Shell.COUPE: Drawing(
        body="M6 42V33Q6 28 12 27L28 24 44 14Q47 12 51 12H64Q69 12 74 15L88 24 108 28Q115 30 115 36V42Z",
        glass="M36 24 48 16H58V24ZM61 16H66Q69 16 72 18L81 24H61Z",
        dark="M6 42H115V45H6Z",
    ),
    Shell.HATCH: Drawing(
        body="M10 42V24L17 13Q19 10 23 10H62Q67 10 71 14L82 24 104 27Q112 28 112 35V42Z",
        glass="M18 23 23 14H41V23ZM44 14H61Q65 14 68 17L74 23H44Z",
        dark="M10 42H112V45H10Z",
        wheels=(28.0, 90.0, 10.0),
    ),
    Shell.BUGGY: Drawing(
        body="M14 36 20 28H48L54 33H76L84 27 106 31 112 38H102L84 41H30Z",
        dark="M30 28 38 9H62L78 28H74L60 13H41L34 28ZM52 28 57 12H60L56 28ZM6 24H20V28H10L12 33H8Z",
        wheels=(26.0, 94.0, 13.0),
    ),
    Shell.KART: Drawing(
        body="M18 40V35H34L36 22Q37 20 40 20H44L48 35H82L92 31H110V37L100 41Z",
        dark="M78 33 72 21H76L82 32ZM104 41H116V44H104ZM14 30H30V34H14Z",
        wheels=(26.0, 96.0, 9.0),
    ),
    Shell.PICKUP: Drawing(
        body="M5 40V24H54L60 12Q61 10 64 10H80Q84 10 87 13L95 24 110 27Q116 28 116 34V40Z",
        glass="M61 23 66 14H72V23ZM75 14H80Q82 14 84 16L89 23H75Z",
        dark="M5 40H116V44H5ZM8 20H52V22H8Z",
        wheels=(26.0, 95.0, 11.0),
    ),
    Shell.VAN: Drawing(
        body="M6 42V12Q6 7 11 7H78Q82 7 85 11L98 25 110 29Q115 31 115 36V42Z",
        glass="M74 24V12H78Q80 12 82 14L91 24Z",
        dark="M6 42H115V45H6ZM6 28H70V30H6Z",
        wheels=(28.0, 94.0, 10.0),
    ),
    Shell.WAGON: Drawing(
        body="M6 42V24L12 12Q13 10 16 10H68Q72 10 75 13L86 24 107 28Q115 30 115 36V42Z",
        glass="M14 23 18 14H36V23ZM39 14H54V23H39ZM57 14H67Q70 14 72 16L79 23H57Z",
        dark="M6 42H115V45H6ZM18 8H64V9.6H18Z",
    ),
    Shell.ROVER: Drawing(
        body="M10 36V28H36V20H84V28H112V36Z",
        glass="M70 20 74 10H92V16H80L78 20Z",
        dark="M16 36H106V40H16ZM42 20V8H45V20ZM36 5H51V9H36ZM60 36H64V44H60Z",
        wheels=(22.0, 98.0, 10.0),
    ),
    Shell.ROADSTER: Drawing(
        body="M6 41V32Q6 27 12 26L40 24 44 27H66L70 24 106 28Q115 30 115 36V41Z",
        glass="M64 25 57 13H61L71 25Z",
        dark="M6 41H115V44H6ZM40 24Q40 18 45 18T50 24Z",
    ),
    Shell.WEDGE: Drawing(
        body="M6 42V22L12 18 52 13Q56 12 60 14L114 37V42Z",
        glass="M50 21 57 17 78 27 52 26Z",
        dark="M6 42H114V45H6ZM4 14H20V18H4Z",
    ),
}
