"""Finds the track that a command's ``--track`` names: in the catalogue, a file or the site's database."""

from pathlib import Path
from typing import NamedTuple

from django.db import DEFAULT_DB_ALIAS, Error, connections

from core.management.base import Refusal
from core.management.light import load_apps
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.catalogue.names import find, nearest
from paddock.geometry.files import FILES, MAX_BYTES, read_track
from paddock.geometry.track import TrackGeometry
from paddock.simulator.camera.theme import OFFICIAL

TRACK_HELP = "a catalogue track by any of its names, a track of this site by its address, or an .npy file"


class FoundTrack(NamedTuple):
    """A track in its own direction, and the name of its look: what cameras see of it."""

    geometry: TrackGeometry
    look: str = OFFICIAL.name


def find_track(name: str) -> FoundTrack:
    """A catalogue track by any of its names, the track in an ``.npy`` file, or one of the site's own by its slug.

    The database is asked last, so that the other two need none. Raises UserFault for a file that is not a track and for
    a track whose shape nobody here knows, Refusal of ``track_not_found``, ``track_database`` and ``file_unreadable``.
    """
    named = find(name)
    if named is not None:
        return FoundTrack(named.track.geometry())
    path = Path(name)
    if path.suffix in FILES:
        try:
            with path.open("rb") as file:
                return FoundTrack(read_track(file.read(MAX_BYTES + 1), path.stem, is_open=None))
        except OSError as error:
            raise Refusal.unreadable(error, path) from error
    return _imported(name)


def _imported(name: str) -> FoundTrack:
    catalogue = [track.slug for track in CATALOGUE]
    own: list[str] = []
    if has_database():
        load_apps()
        from django.core.validators import slug_re

        from tracks.models import Track

        try:
            # what is no address at all may not be text to a database
            track = Track.objects.filter(slug=name).first() if slug_re.match(name) else None
            if track is not None:
                return FoundTrack(track.geometry, track.look)
            own = list(Track.objects.exclude(length_m=None).values_list("slug", flat=True))
        except Error as error:
            problem = " ".join(str(error).split())[:200]
            fault = UserFault("track_database", name=name, problem=problem, known=", ".join(catalogue))
            raise Refusal(fault) from error
    closest = ", ".join(nearest(name, own))
    raise Refusal(UserFault("track_not_found", name=name, nearest=closest, known=", ".join(catalogue)))


def has_database() -> bool:
    """Whether there is one to ask; an SQLite file that is not there would be made by asking."""
    from django.db.backends.sqlite3.base import DatabaseWrapper

    database = connections[DEFAULT_DB_ALIAS]
    if not isinstance(database, DatabaseWrapper) or database.is_in_memory_db():
        return True
    return Path(database.settings_dict["NAME"]).exists()
