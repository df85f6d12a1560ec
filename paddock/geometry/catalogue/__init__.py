"""The tracks that come with Paddock: those of the old console under their names, and an oval of our own. No Django.

``data/catalogue.csv`` lists them in the order of pages: the league's six, the oval, then the others by name. ``data/``
holds their files as the official simulator has them (the NOTICE beside says whose they are).
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from ..npy import read_npy
from ..track import TrackGeometry
from .descriptions import DESCRIPTIONS

_DATA = files(__package__) / "data"


@dataclass(frozen=True)
class CatalogueTrack:
    """One track of the catalogue, with what its file would tell, so that nobody need read it to list it.

    ``file``: what the official simulator calls it, and its file here without ``.npy``; ``fingerprint``, ``length_m``,
    ``width_m`` (median), ``direction``: of its geometry; ``corners`` and ``difficulty``: see
    :func:`paddock.geometry.character.character_of`; ``is_open``: driven from start to end; ``description``: English,
    marked for translation, empty where name and shape say all; ``also``: further files and names of the same road in
    the official simulator.
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
        """Every name of the track, see :mod:`.names`; the address first."""
        return (self.slug, self.name, self.file, *self.also)

    @property
    def npy(self) -> bytes:
        """The file itself, see :mod:`paddock.geometry.npy`."""
        return (_DATA / f"{self.file}.npy").read_bytes()

    def geometry(self, direction: str | None = None) -> TrackGeometry:
        """The track driven ``"ccw"`` or ``"cw"``; without a direction the way its file runs. Always the same object."""
        return _geometry(self.slug, direction or self.direction)


@cache
def _geometry(slug: str, direction: str) -> TrackGeometry:
    track = by_slug(slug)
    if direction != track.direction:
        return _geometry(slug, track.direction).in_direction(direction)
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
