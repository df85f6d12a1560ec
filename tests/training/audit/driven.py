"""The eight drives of a place, driven once for all tests of a process."""

from __future__ import annotations

from functools import cache

from paddock.geometry.catalogue import by_slug
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import TIME_TRIAL
from training.rewards.audit.drives import RecordedDrive, eight_drives

_kept = cache(eight_drives)


def driven(track: TrackGeometry, direction: str, race_type: str = TIME_TRIAL) -> tuple[RecordedDrive, ...]:
    """In the place of ``eight_drives``."""
    return _kept(track, direction, race_type)


def driven_on_the_oval() -> tuple[RecordedDrive, ...]:
    return driven(by_slug("oval").geometry(), "ccw")
