"""Every name of the catalogue's tracks, and the closest matches of an unknown name."""

# Names are the address (``po-chun-speedway``), the name in the old console (``Po-Chun Speedway``) and the files in the
# official simulator (``penbay_open``, and ``penbay_open_cw`` for the clockwise variant).

import re
from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

from . import CATALOGUE, CatalogueTrack

NEAREST = 3
_LONGEST = 64  # characters of an unknown name that are compared; no name is longer
_SEPARATOR = re.compile(r"(?<=[a-z0-9])[ _:-]+(?=[a-z0-9])")
_VARIANT = re.compile(r"(.+)[ _-](c?cw)", re.IGNORECASE)


class NamedTrack(NamedTuple):
    """A track of the catalogue, and the direction in its name, if any."""

    track: CatalogueTrack
    direction: str | None = None


def find(name: str) -> NamedTrack | None:
    """The track of this name. Case and the separators between words are ignored."""
    track = _by_key().get(key(name))
    if track is not None:
        return NamedTrack(track)
    variant = _VARIANT.fullmatch(name)
    track = _by_key().get(key(variant[1])) if variant else None
    return NamedTrack(track, variant[2].lower()) if track is not None and variant else None


def direction_in(name: str) -> str | None:
    """The direction in the name of a variant such as ``penbay_open_cw``, or None."""
    found = find(name)
    return found.direction if found else None


def holding(words: str) -> list[CatalogueTrack]:
    """The tracks one of whose names contains ``words``, or is ``words``."""
    part, named = key(words.strip()), find(words.strip())
    return [
        track for track in CATALOGUE if (named and named.track is track) or any(part in key(one) for one in track.names)
    ]


def nearest(name: str, others: Iterable[str] = ()) -> list[str]:
    """The names that :func:`closest` finds."""
    return list(closest(name, others).values())


def closest(name: str, others: Iterable[str] = (), catalogue: Iterable[CatalogueTrack] = CATALOGUE) -> dict[str, str]:
    """The closest names by address, of at most three tracks: an address, or another name with the address. ``others``:
    addresses of tracks outside the catalogue."""
    from difflib import get_close_matches

    spelling = {key(one): (one, track.slug) for track in catalogue for one in reversed(track.names)}
    spelling = {key(one): (one, one) for one in others} | spelling
    close = get_close_matches(key(name[:_LONGEST]), spelling, n=4 * NEAREST, cutoff=0)
    found: dict[str, str] = {}
    for written, slug in (spelling[one] for one in close):
        found.setdefault(slug, slug if written == slug else f"{written} ({slug})")
    return dict(list(found.items())[:NEAREST])


def key(name: str) -> str:
    """The key by which a name is compared."""
    return _SEPARATOR.sub("", name.casefold())


@cache
def _by_key() -> dict[str, CatalogueTrack]:
    return {key(name): track for track in CATALOGUE for name in track.names}
