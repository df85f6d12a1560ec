"""The dozen shells, drawn for Paddock: from the side as pages show a car, and from above as it drives in a replay.

From the side: 120 x 56 units, driving to the right. From above: 120 x 68 units around the middle of the car, driving to
the right; a car is 0.33 m long, so that a unit is about 3 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

from .looks import Shell

GROUND = 50.0


@dataclass(frozen=True)
class FromTheSide:
    """One shell from the side. ``body``, ``glass``, ``dark``: SVG path data; ``wheels``: x of both axles, and
    the radius."""

    body: str
    glass: str = ""
    dark: str = ""
    wheels: tuple[float, float, float] = (28.0, 92.0, 10.0)


FROM_THE_SIDE: dict[str, FromTheSide] = {
    # the car of this house: a low nose, a camera mast, a slanted tail as in the mark
    Shell.PADDOCK: FromTheSide(
        body="M8 42 14 27Q15 24 19 24H40L54 16Q57 14 61 14H76Q80 14 83 16L94 25 110 30Q115 32 115 37V42Z",
        glass="M46 24 57 18H74L84 25Z",
        dark="M62 14V6H72V11H66V14ZM8 42H115V45H8Z",
    ),
    Shell.FORMULA: FromTheSide(
        body="M12 34 18 24H40L46 16Q48 14 51 15L60 22 74 25 108 35Q114 37 114 40H104L18 41Z",
        glass="M52 22 58 18 66 24Z",
        dark="M4 14H22V18H16L18 26H14L10 18H4ZM100 42H119V45H100ZM20 41H104V44H20Z",
        wheels=(26.0, 94.0, 11.0),
    ),
    Shell.COUPE: FromTheSide(
        body="M6 42V33Q6 28 12 27L28 24 44 14Q47 12 51 12H64Q69 12 74 15L88 24 108 28Q115 30 115 36V42Z",
        glass="M36 24 48 16H58V24ZM61 16H66Q69 16 72 18L81 24H61Z",
        dark="M6 42H115V45H6Z",
    ),
    Shell.HATCH: FromTheSide(
        body="M10 42V24L17 13Q19 10 23 10H62Q67 10 71 14L82 24 104 27Q112 28 112 35V42Z",
        glass="M18 23 23 14H41V23ZM44 14H61Q65 14 68 17L74 23H44Z",
        dark="M10 42H112V45H10Z",
        wheels=(28.0, 90.0, 10.0),
    ),
    Shell.BUGGY: FromTheSide(
        body="M14 36 20 28H48L54 33H76L84 27 106 31 112 38H102L84 41H30Z",
        dark="M30 28 38 9H62L78 28H74L60 13H41L34 28ZM52 28 57 12H60L56 28ZM6 24H20V28H10L12 33H8Z",
        wheels=(26.0, 94.0, 13.0),
    ),
    Shell.KART: FromTheSide(
        body="M18 40V35H34L36 22Q37 20 40 20H44L48 35H82L92 31H110V37L100 41Z",
        dark="M78 33 72 21H76L82 32ZM104 41H116V44H104ZM14 30H30V34H14Z",
        wheels=(26.0, 96.0, 9.0),
    ),
    Shell.PICKUP: FromTheSide(
        body="M5 40V24H54L60 12Q61 10 64 10H80Q84 10 87 13L95 24 110 27Q116 28 116 34V40Z",
        glass="M61 23 66 14H72V23ZM75 14H80Q82 14 84 16L89 23H75Z",
        dark="M5 40H116V44H5ZM8 20H52V22H8Z",
        wheels=(26.0, 95.0, 11.0),
    ),
    Shell.VAN: FromTheSide(
        body="M6 42V12Q6 7 11 7H78Q82 7 85 11L98 25 110 29Q115 31 115 36V42Z",
        glass="M74 24V12H78Q80 12 82 14L91 24Z",
        dark="M6 42H115V45H6ZM6 28H70V30H6Z",
        wheels=(28.0, 94.0, 10.0),
    ),
    Shell.WAGON: FromTheSide(
        body="M6 42V24L12 12Q13 10 16 10H68Q72 10 75 13L86 24 107 28Q115 30 115 36V42Z",
        glass="M14 23 18 14H36V23ZM39 14H54V23H39ZM57 14H67Q70 14 72 16L79 23H57Z",
        dark="M6 42H115V45H6ZM18 8H64V9.6H18Z",
    ),
    Shell.ROVER: FromTheSide(
        body="M10 36V28H36V20H84V28H112V36Z",
        glass="M70 20 74 10H92V16H80L78 20Z",
        dark="M16 36H106V40H16ZM42 20V8H45V20ZM36 5H51V9H36ZM60 36H64V44H60Z",
        wheels=(22.0, 98.0, 10.0),
    ),
    Shell.ROADSTER: FromTheSide(
        body="M6 41V32Q6 27 12 26L40 24 44 27H66L70 24 106 28Q115 30 115 36V41Z",
        glass="M64 25 57 13H61L71 25Z",
        dark="M6 41H115V44H6ZM40 24Q40 18 45 18T50 24Z",
    ),
    Shell.WEDGE: FromTheSide(
        body="M6 42V22L12 18 52 13Q56 12 60 14L114 37V42Z",
        glass="M50 21 57 17 78 27 52 26Z",
        dark="M6 42H114V45H6ZM4 14H20V18H4Z",
    ),
}


_COVERED = "M-38-31H-20V31H-38ZM20-31H38V31H20Z"  # wheels under a body, of which the edges show
_FREE = "M-48-33H-24V-18H-48ZM-48 18H-24V33H-48ZM24-33H48V-18H24ZM24 18H48V33H24Z"


@dataclass(frozen=True)
class FromAbove:
    """One shell from above, as SVG path data. ``under``: wheels and what else lies below the body; ``dark``: dark parts
    on top of it."""

    body: str
    glass: str = ""
    dark: str = ""
    under: str = _COVERED


FROM_ABOVE: dict[str, FromAbove] = {
    Shell.PADDOCK: FromAbove(
        body="M-54-20Q-54-26-48-26H20Q42-26 53-13Q57-7 57 0T53 13Q42 26 20 26H-48Q-54 26-54 20Z",
        glass="M16-19Q27-10 27 0T16 19L4 17Q8 0 4-17ZM-30-6H-18V6H-30Z",
    ),
    Shell.FORMULA: FromAbove(
        body="M-52-9-22-15 10-12 56-5Q60 0 56 5L10 12-22 15-52 9Z",
        glass="M-12-6H8L13 0 8 6H-12Z",
        under=f"{_FREE}M-60-24H-50V24H-60ZM46-25H54V25H46Z",
    ),
    Shell.COUPE: FromAbove(
        body="M-54-20Q-54-26-46-26H32Q54-22 57 0 54 22 32 26H-46Q-54 26-54 20Z",
        glass="M16-20Q27-10 27 0T16 20L4 16Q8 0 4-16ZM-40-15-26-17Q-23 0-26 17L-40 15Q-43 0-40-15Z",
    ),
    Shell.HATCH: FromAbove(
        body="M-50-22Q-50-27-44-27H28Q47-26 51-12V12Q47 26 28 27H-44Q-50 27-50 22Z",
        glass="M20-22Q31-10 31 0T20 22L8 18Q11 0 8-18ZM-47-18H-39V18H-47Z",
    ),
    Shell.BUGGY: FromAbove(
        body="M-42-12 8-17 52-8V8L8 17-42 12Z",
        glass="M10-10 20-8V8L10 10Z",
        dark="M-28-11H4V-7H-28ZM-28 7H4V11H-28Z",
        under="M-54-34H-24V-16H-54ZM-54 16H-24V34H-54ZM24-34H50V-18H24ZM24 18H50V34H24Z",
    ),
    Shell.KART: FromAbove(
        body="M-44-14H-12L-2-8H42L48-18H58V18H48L42 8H-2L-12 14H-44Z",
        glass="M-4-5H4V5H-4Z",
        dark="M-34-8H-12V8H-34Z",
        under=_FREE,
    ),
    Shell.PICKUP: FromAbove(
        body="M-57-25H30Q50-24 55-12V12Q50 24 30 25H-57Z",
        glass="M22-19Q32-9 32 0T22 19L12 17V-17Z",
        dark="M-52-19H-6V19H-52Z",
    ),
    Shell.VAN: FromAbove(
        body="M-57-26H42Q54-24 57-12V12Q54 24 42 26H-57Z",
        glass="M34-22Q47-10 47 0T34 22L26 20V-20Z",
        dark="M-48-15H16V-12H-48ZM-48 12H16V15H-48Z",
    ),
    Shell.WAGON: FromAbove(
        body="M-57-22Q-57-26-52-26H32Q53-22 56 0 53 22 32 26H-52Q-57 26-57 22Z",
        glass="M16-20Q27-10 27 0T16 20L4 16Q8 0 4-16ZM-54-18H-47V18H-54Z",
        dark="M-44-21H2V-18H-44ZM-44 18H2V21H-44Z",
    ),
    Shell.ROVER: FromAbove(
        body="M-50-17H50V17H-50Z",
        glass="M22-9H40V9H22Z",
        dark="M-40-10H0V10H-40Z",
        under="M-54-33H-32V-19H-54ZM-54 19H-32V33H-54ZM-11-33H11V-19H-11ZM-11 19H11V33H-11Z"
        "M32-33H54V-19H32ZM32 19H54V33H32Z",
    ),
    Shell.ROADSTER: FromAbove(
        body="M-54-20Q-54-26-46-26H32Q54-22 57 0 54 22 32 26H-46Q-54 26-54 20Z",
        glass="M14-19Q23-9 23 0T14 19L9 17Q15 0 9-17Z",
        dark="M-24-16H6Q12 0 6 16H-24Q-29 0-24-16Z",
    ),
    Shell.WEDGE: FromAbove(
        body="M-55-27-20-26 50-16 60-8V8L50 16-20 26-55 27Z",
        glass="M8-17 34-11V11L8 17Q13 0 8-17Z",
        dark="M-61-29H-51V29H-61Z",
    ),
}
