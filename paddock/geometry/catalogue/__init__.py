"""The tracks that Paddock includes: those of the old console by their names, and an oval."""

# ``data/catalogue.csv`` lists them in the order of pages: the league's six, the oval, then the others by name.
# ``data/`` holds their files as the official simulator has them; the NOTICE beside them names the owner.

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from paddock.errors.reasons import gettext_noop as _

if TYPE_CHECKING:
    from ..track import TrackGeometry

_DATA = files(__package__) / "data"
DESCRIPTIONS: dict[str, str] = {
    "baja-turnpike": _(
        "Short and angular: one long full-throttle straight into a sharp hairpin, then tight "
        "90-degree turns to the finish."
    ),
    "baja-highway": _(
        "The turnpike extended: a second massive straight, another hairpin, a turn of increasing radius "
        "and tight cutbacks."
    ),
    "kuei-raceway": _(
        "Fast: two straights between two hairpins, then a chicane into a cutback hairpin and a sweeping run home."
    ),
    "kuei-super-raceway": _(
        "The raceway extended: after the hairpins a long straight and a technical section of four double apexes."
    ),
    "cosmic-loop": _("One sprint straight, several 90-degree turns and two hairpins."),
    "cosmic-circuit": _("Several 90-degree turns joined by bends, without a true straight."),
    "straight-track": _("The only open track: straight from start to finish. Each lap begins at the start."),
    "oval": _("Two straights and two wide bends, for a first lap."),
}


@dataclass(frozen=True)
class CatalogueTrack:
    """One track of the catalogue.

    ``file``: its name in the official simulator, and of its file here without ``.npy``; ``width_m``: the median;
    ``corners``, ``difficulty``: see :func:`paddock.geometry.character.character_of`; ``description``: English, marked
    for translation, or empty; ``also``: further files and names of the same road in the official simulator.
    """

    slug: str
    name: str
    file: str
    fingerprint: str
    length_m: float
    width_m: float
    direction: str
    corners: int
    difficulty: int
    is_open: bool = False
    description: str = ""
    also: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All names of the track, the address first."""
        return (self.slug, self.name, self.file, *self.also)

    @property
    def npy(self) -> bytes:
        return (_DATA / f"{self.file}.npy").read_bytes()

    def geometry(self, direction: str | None = None) -> TrackGeometry:
        """The track driven ``"ccw"`` or ``"cw"``, by default as in its file; always the same object."""
        return _geometry(self.slug, direction or self.direction)


@cache
def _geometry(slug: str, direction: str) -> TrackGeometry:
    track = by_slug(slug)
    if direction != track.direction:
        return _geometry(slug, track.direction).in_direction(direction)
    from ..files import read_npy  # loads numpy

    return read_npy(track.npy, track.name, is_open=track.is_open)


def by_slug(slug: str) -> CatalogueTrack:
    """The catalogue track called ``slug``. Raises KeyError."""
    return _BY_SLUG[slug]


def _entry(row: dict[str, str]) -> CatalogueTrack:
    return CatalogueTrack(
        slug=row["slug"],
        name=row["name"],
        file=row["file"],
        fingerprint=row["fingerprint"],
        length_m=float(row["length_m"]),
        width_m=float(row["width_m"]),
        direction=row["direction"],
        corners=int(row["corners"]),
        difficulty=int(row["difficulty"]),
        is_open=row["is_open"] == "yes",
        description=DESCRIPTIONS.get(row["slug"], ""),
        also=tuple(row["also"].split("|")) if row["also"] else (),
    )


CATALOGUE: tuple[CatalogueTrack, ...] = tuple(
    map(_entry, csv.DictReader((_DATA / "catalogue.csv").read_text().splitlines()))
)
_BY_SLUG = {track.slug: track for track in CATALOGUE}
