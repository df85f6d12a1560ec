"""A lap that was measured wrongly is put right by who organises the race, with a reason that everybody reads."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from django.db import transaction

from paddock.errors import UserFault

from ...models import LapCorrection, MeasuredLap
from ..locks import lock_entry
from .gates import require_may_correct
from .laps import MOST_FAULTS, check_time
from .sessions import settle

if TYPE_CHECKING:
    from accounts.models import Racer

FIELDS = ("time_ms", "off_tracks", "resets", "valid")
_LONGEST = 255


@transaction.atomic
def correct_lap(
    *,
    lap: MeasuredLap,
    by: Racer,
    reason: str,
    now: datetime,
    time_ms: int | None = None,
    off_tracks: int | None = None,
    resets: int | None = None,
    valid: bool | None = None,
) -> LapCorrection:
    """Change what is given of a lap, or invalidate it; the old values stay in the log. None leaves a value as it is.

    Raises UserFault("correction_needs_a_reason" | "correction_changes_nothing" | "lap_faults"), what
    :func:`~races.services.timing.laps.check_time` and :func:`~races.services.timing.gates.require_may_correct` raise.
    """
    race = lap.session.race
    require_may_correct(race, by, now)
    reason = " ".join(reason.split())[:_LONGEST]
    if not reason:
        raise UserFault("correction_needs_a_reason")
    entry = lock_entry(lap.session.entry)
    lap = MeasuredLap.objects.select_for_update().get(pk=lap.pk)
    before = {name: getattr(lap, name) for name in FIELDS}
    sent = {"time_ms": time_ms, "off_tracks": off_tracks, "resets": resets, "valid": valid}
    after = before | {name: value for name, value in sent.items() if value is not None}
    if after == before:
        raise UserFault("correction_changes_nothing")
    check_time(race, lap.number, after["time_ms"], valid=after["valid"])
    if not all(0 <= after[name] <= MOST_FAULTS for name in ("off_tracks", "resets")):
        raise UserFault("lap_faults", lap=lap.number, most=MOST_FAULTS)
    for name, value in after.items():
        setattr(lap, name, value)
    lap.corrected = True
    lap.save(update_fields=[*FIELDS, "corrected"])
    made = LapCorrection.objects.create(lap=lap, by=by, at=now, reason=reason, before=before, after=after)
    settle(entry.race, [entry], now)
    return made
