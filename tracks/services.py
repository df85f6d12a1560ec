"""Every write to the catalogue of tracks."""

from __future__ import annotations

import hashlib
import re
from datetime import datetime
from typing import TYPE_CHECKING

from django.db import IntegrityError, transaction
from django.db.models import Count, ProtectedError, Q
from django.utils import timezone
from django.utils.text import slugify
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, limit_of, only, used_by
from core.audit.recording import audited
from core.database.columns import length_of
from core.database.locks import hold
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE, CatalogueTrack
from paddock.geometry.catalogue.names import find
from paddock.geometry.character import character_of, median_width
from paddock.geometry.files import read_track, write_npy
from paddock.geometry.track import TrackGeometry

from .models import Direction, Track, TrackLook
from .selectors import track_named

if TYPE_CHECKING:
    from accounts.models import Racer

NAME_LIMIT = length_of(Track, "name")
SLUG_LIMIT = length_of(Track, "slug")
# Addresses that pages use for something else.
RESERVED_SLUGS = frozenset({"import", "new", "to-choose"})
_SLUG = re.compile(r"[a-z0-9]+(?:-[a-z0-9]+)*\Z")


def _tracks(racers: Racers, now: datetime) -> CountedRows:
    mine = Track.objects.exclude(owner=None)
    return only(mine, "owner", racers).order_by().values_list("owner").annotate(Count("pk"))


TRACKS = Quota(3, "tracks", "TRACKS_PER_RACER", _("Imported tracks"), _tracks)


@audited("track.imported", _("Track imported"))
def import_track(
    *,
    data: bytes,
    name: str,
    owner: Racer | None,
    now: datetime,
    slug: str | None = None,
    description: str = "",
    look: str = TrackLook.OFFICIAL,
    is_open: bool = False,
    scale: float = 1.0,
    least_width_m: float = 0.0,
) -> Track:
    """Keep the track of a file (:func:`paddock.geometry.files.read_track`), under ``slug`` or an address from its name.

    ``owner=None``: an operator, without a limit; a known track is returned, and a track of which only the name was
    known gets its shape. ``is_open``: driven from start to end. Raises UserFault("track_..."), "track_known" with the
    ``name`` and ``slug`` of the known one.
    """
    name = _valid_name(name)
    if look not in TrackLook.values:
        raise UserFault("track_look", looks=", ".join(TrackLook.values))
    shapeless = _shapeless(name, slug) if owner is None else None
    if slug is not None and shapeless is None:
        _refuse_slug(slug)
    geometry = read_track(data, name, is_open=is_open, scale=scale, least_width_m=least_width_m)
    with transaction.atomic():
        if owner is not None and not owner.is_staff:
            _refuse_above_limit(owner)
        known = Track.objects.filter(fingerprint=geometry.fingerprint).first()
        if known is not None:
            return _known(known, owner)
        track = _row(geometry, slug=slug or free_slug(name), name=name)
        if shapeless is not None:
            track.pk, track.slug = shapeless.pk, shapeless.slug
        track.owner, track.created_at, track.look = owner, now, look
        track.description = " ".join(description.split())[: Track._meta.get_field("description").max_length]
        try:
            with transaction.atomic():
                track.save(force_insert=shapeless is None)
        except IntegrityError:  # somebody imported the same file or took the address at this moment
            known = Track.objects.filter(fingerprint=geometry.fingerprint).first()
            if known is None:
                raise UserFault("track_slug", slug=track.slug) from None
            return _known(known, owner)
    return track


@transaction.atomic
def load_catalogue(*, now: datetime | None = None) -> list[Track]:
    """Put the tracks that come with Paddock into the database; known ones stay.

    A track with a changed shape is a new row at the known address; the old one keeps its races at another address.
    Tracks known by name only are replaced by those of the catalogue.
    """
    now = now or timezone.now()
    prints = [entry.fingerprint for entry in CATALOGUE]
    known = {track.fingerprint: track for track in Track.objects.defer("npy").filter(fingerprint__in=prints)}
    rows = [
        track if (track := known.get(entry.fingerprint)) and _is_as(track, entry) else _catalogue_row(entry, now)
        for entry in CATALOGUE
    ]
    for unknown in Track.objects.filter(length_m=None):
        named = find(unknown.name) or find(unknown.slug)
        if named is not None:
            _replace(unknown, next(row for row in rows if row.slug == named.track.slug))
    return rows


def recorded_track(name: str, *, now: datetime) -> Track:
    """The track that an imported season names, by address, catalogue name or name; else a new row with only the
    name."""
    track = track_named(name) or track_named(slugify(name).replace("_", "-"))
    named = None if track else find(name)
    if named is not None:
        return _catalogue_row(named.track, now)
    return (
        track
        or Track.objects.filter(name__iexact=name).order_by("pk").first()
        or Track.objects.create(
            slug=free_slug(name),
            name=name,
            npy=b"",
            fingerprint=f"unknown:{hashlib.sha256(name.encode()).hexdigest()[:48]}",
            direction=Direction.CCW,
            created_at=now,
        )
    )


@audited("track.deleted", _("Track deleted"), target="track")
def delete_track(*, track: Track) -> None:
    """Delete a track that nothing was driven on. Raises UserFault("track_in_use")."""
    try:
        with transaction.atomic():
            track.delete()
    except ProtectedError:
        raise UserFault("track_in_use") from None


def free_slug(name: str) -> str:
    """An address for a track of this name that no track has."""
    base = slugify(name)[: SLUG_LIMIT - 6].strip("-_").replace("_", "-") or "track"
    slug, number = base, 1
    while _is_reserved(slug) or Track.objects.filter(slug=slug).exists():
        number += 1
        slug = f"{base}-{number}"
    return slug


def _replace(unknown: Track, track: Track) -> None:
    """Give whatever refers to the first track the second one, and delete the first."""
    for relation in Track._meta.related_objects:
        rows = relation.related_model._base_manager.filter(**{relation.field.name: unknown})
        rows.update(**{relation.field.name: track})
    unknown.delete()


def _texts(entry: CatalogueTrack) -> dict[str, object]:
    return {"name": entry.name, "description": entry.description, "is_catalogue": True}


def _is_as(track: Track, entry: CatalogueTrack) -> bool:
    return track.slug == entry.slug and all(getattr(track, name) == value for name, value in _texts(entry).items())


def _catalogue_row(entry: CatalogueTrack, now: datetime) -> Track:
    texts = _texts(entry)
    track = Track.objects.defer("npy").filter(fingerprint=entry.fingerprint).first()
    if track is not None and track.slug == entry.slug:
        if not _is_as(track, entry):
            Track.objects.filter(pk=track.pk).update(**texts)
            track.refresh_from_db()
        return track
    older = Track.objects.filter(slug=entry.slug).first()
    if older is not None:
        older.slug, older.is_catalogue = free_slug(f"{entry.slug}-{older.fingerprint[:6]}"), False
        older.save(update_fields=["slug", "is_catalogue"])
    if track is None:
        track = Track(npy=entry.npy, created_at=now)
        for field in ("name", "fingerprint", "length_m", "width_m", "direction", "corners", "difficulty", "is_open"):
            setattr(track, field, getattr(entry, field))
    track.slug, track.owner = entry.slug, None
    for field, value in texts.items():
        setattr(track, field, value)
    track.save()
    return track


def _row(geometry: TrackGeometry, *, slug: str, name: str) -> Track:
    corners, difficulty = character_of(geometry)
    return Track(
        slug=slug,
        name=name,
        npy=write_npy(geometry),
        fingerprint=geometry.fingerprint,
        length_m=round(geometry.length, 3),
        width_m=round(median_width(geometry), 3),
        direction=geometry.direction,
        is_open=geometry.is_open,
        corners=corners,
        difficulty=difficulty,
    )


def _shapeless(name: str, slug: str | None) -> Track | None:
    """The track of this address, or else of this name, of which nothing but the name is known: whose shape this is."""
    names = Q(slug=slug) if slug is not None else Q(name__iexact=name) | Q(name__iexact=name.replace(" ", "_"))
    return Track.objects.filter(names, length_m=None).order_by("pk").first()


def _known(track: Track, owner: Racer | None) -> Track:
    if owner is None:
        return track
    raise UserFault("track_known", name=track.name, slug=track.slug)


def _valid_name(name: str) -> str:
    name = " ".join(name.split())
    if not 1 <= len(name) <= NAME_LIMIT:
        raise UserFault("track_name", limit=NAME_LIMIT)
    return name


def _refuse_slug(slug: str) -> None:
    taken = _is_reserved(slug) or Track.objects.filter(slug=slug).exists()
    if taken or len(slug) > SLUG_LIMIT or not _SLUG.match(slug):
        raise UserFault("track_slug", slug=slug[:SLUG_LIMIT])


def _is_reserved(slug: str) -> bool:
    """Whether the address is a page's, or another name of a catalogue track."""
    named = find(slug)
    return slug in RESERVED_SLUGS or (named is not None and named.track.slug != slug)


def _refuse_above_limit(owner: Racer) -> None:
    """Counted under the racer's lock, so that two tabs do not both get the last place."""
    hold(owner)
    limit = limit_of(owner, TRACKS.name)
    if used_by(owner, TRACKS.name, timezone.now()) >= limit:
        raise UserFault("track_limit", limit=limit)
