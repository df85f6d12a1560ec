"""Which seasons and rounds can be deleted: those of which no race has opened or has entries."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from paddock.errors import UserFault
from races.models import Entry, Race

from ..models import Round


def why_kept(race: Race, now: datetime) -> UserFault | None:
    """Why a race of a season cannot be deleted; None where it can."""
    was_cancelled_before = race.cancelled_at is not None and race.cancelled_at <= race.opens_at
    if race.imported_at is not None or (race.opens_at <= now and not was_cancelled_before):
        return UserFault("season_has_opened", race=race.name)
    if Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False).exists():
        return UserFault("season_has_entries", race=race.name)
    return None


def kept_rounds(rounds: Iterable[Round], now: datetime) -> dict[int, UserFault]:
    """Why rounds cannot be deleted, by id; without those that can."""
    found = {one.pk: why_kept(one.race, now) for one in rounds}
    return {pk: fault for pk, fault in found.items() if fault is not None}
