"""The tracks that come with Paddock: drawn by us after the lengths and characters that learners know. No Django."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from paddock.errors.reasons import gettext_noop

from ..track import CCW, TrackGeometry
from .curve import road
from .shapes import SHAPES

ROAD_WIDTH_M = 1.07
SPACING_M = 0.15

_ = gettext_noop


@dataclass(frozen=True)
class CatalogueTrack:
    """One track of the catalogue. ``stated_length_m``: the length it is known by; ``finish_m``: how far down the
    finish straight the finish line lies; ``description``: English, marked for translation."""

    slug: str
    name: str
    stated_length_m: float
    finish_m: float
    description: str

    def geometry(self, direction: str = CCW) -> TrackGeometry:
        """The track driven ``"ccw"`` (as drawn) or ``"cw"``; the same object every time."""
        return _geometry(self, direction)


@cache
def _geometry(track: CatalogueTrack, direction: str) -> TrackGeometry:
    if direction != CCW:
        return _geometry(track, CCW).in_direction(direction)
    lines = road(
        SHAPES[track.slug],
        finish_m=track.finish_m,
        length_m=track.stated_length_m,
        width_m=ROAD_WIDTH_M,
        spacing_m=SPACING_M,
    )
    # To the micrometre, so that the last bit of one machine's sine does not make another track (and another lap time).
    centre, left, right = (np.round(line, 6) + 0.0 for line in lines)
    return TrackGeometry.from_arrays(track.name, centre, inner=left, outer=right)


CATALOGUE: tuple[CatalogueTrack, ...] = (
    CatalogueTrack(
        slug="baja-turnpike",
        name="Baja Turnpike",
        stated_length_m=40.79,
        finish_m=4.6,
        description=_(
            "Short and angular: full throttle down one long straight into a harsh hairpin, "
            "then tight 90-degree turns all the way home."
        ),
    ),
    CatalogueTrack(
        slug="baja-highway",
        name="Baja Highway",
        stated_length_m=65.18,
        finish_m=4.6,
        description=_(
            "The turnpike extended: a second massive straight, another hairpin, a turn of increasing radius "
            "and tight cutbacks."
        ),
    ),
    CatalogueTrack(
        slug="kuei-raceway",
        name="Kuei Raceway",
        stated_length_m=46.15,
        finish_m=3.0,
        description=_(
            "Fast: two straights between two hairpins, then a chicane into a cutback hairpin and a sweeping run home."
        ),
    ),
    CatalogueTrack(
        slug="kuei-super-raceway",
        name="Kuei Super Raceway",
        stated_length_m=60.96,
        finish_m=3.0,
        description=_(
            "The raceway extended: after the hairpins a long straight and a technical section of four double apexes."
        ),
    ),
    CatalogueTrack(
        slug="cosmic-loop",
        name="Cosmic Loop",
        stated_length_m=46.18,
        finish_m=4.0,
        description=_("One sprint straight, several 90-degree turns and two hairpins."),
    ),
    CatalogueTrack(
        slug="cosmic-circuit",
        name="Cosmic Circuit",
        stated_length_m=62.24,
        finish_m=1.0,
        description=_("Several 90-degree turns joined by bends: there is no true straight, so the car never rests."),
    ),
    CatalogueTrack(
        slug="oval",
        name="Paddock Oval",
        stated_length_m=18.0,
        finish_m=1.5,
        description=_("Two straights and two wide bends: the place for a first lap."),
    ),
)


def by_slug(slug: str) -> CatalogueTrack:
    """The catalogue track called ``slug``. Raises KeyError."""
    return _BY_SLUG[slug]


_BY_SLUG = {track.slug: track for track in CATALOGUE}
