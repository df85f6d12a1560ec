"""Sensors at the finish line: their tokens, and laps from their crossings.

A lap is the difference of two crossings on the sensor's clock, so neither its setting nor the network's delay matters.
For a sensor without a clock, the time of receipt counts.
"""

import hashlib
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.db import transaction
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from paddock.errors import UserFault

from ...entries.services.locks import lock_entry
from ...entries.time_checks import moment
from ...models import Crossing, CrossingVerdict, MeasuredLap, Race, TimedSession, TimingSensor
from ...models.race import LONGEST_LAP_MS
from ...models.timing import MOST_LAPS
from .checks import require_driven_in_time, require_organiser
from .guests import clean_name
from .sessions import publish_ended, settle

MOST_SENSORS = 20
PREFIX = "pds_"


@dataclass(frozen=True)
class Taken:
    """What a crossing was taken for, and the lap that it ended. ``again``: it had come before."""

    verdict: str
    session: TimedSession
    lap: MeasuredLap | None = None
    again: bool = False


@audited("sensor.made", _("Timing sensor added"))
@transaction.atomic
def make_sensor(*, race: Race, name: str, by: Racer, now: datetime) -> tuple[TimingSensor, str]:
    """A sensor of a race and its token, never to be seen again. Raises UserFault("race_not_physical" | "race_not_yours"
    | "sensors_too_many" | "guest_name")."""
    require_organiser(race, by)
    if TimingSensor.objects.filter(race=race, revoked_at=None).count() >= MOST_SENSORS:
        raise UserFault("sensors_too_many", most=MOST_SENSORS)
    text = PREFIX + get_random_string(40)
    sensor = TimingSensor.objects.create(
        race=race, name=clean_name(name), token_sha256=_digest(text), hint=text[:10], made_at=now, made_by=by
    )
    return sensor, text


@audited("sensor.revoked", _("Timing sensor revoked"), target="sensor")
@transaction.atomic
def revoke_sensor(*, sensor: TimingSensor, by: Racer, now: datetime) -> TimingSensor:
    """Revoke a sensor's token; its laps stay. Raises UserFault("race_not_physical" | "race_not_yours")."""
    require_organiser(sensor.race, by)
    TimingSensor.objects.filter(pk=sensor.pk, revoked_at=None).update(revoked_at=now)
    for session in TimedSession.objects.filter(sensor=sensor, ended_at=None, discarded_at=None):
        session.ended_at = now
        session.save(update_fields=["ended_at"])
        publish_ended(session, now)
    sensor.refresh_from_db()
    return sensor


def sensor_with(token: str) -> TimingSensor:
    """The sensor that a token belongs to. Raises UserFault("sensor_token" | "sensor_revoked")."""
    found = TimingSensor.objects.filter(token_sha256=_digest(token)).select_related("race").first() if token else None
    if found is None:
        raise UserFault("sensor_token")
    if found.revoked_at is not None:
        raise UserFault("sensor_revoked", when=moment(found.revoked_at))
    return found


@transaction.atomic
def take_crossing(
    *, sensor: TimingSensor, number: int, now: datetime, at_ms: int | None = None, boot: str = ""
) -> Taken:
    """Take a crossing of the line: it begins a lap, ends one, or repeats an earlier request.

    ``number``: counts the crossings since the sensor's start ``boot``; a repeated number is the same crossing.
    ``at_ms``: the sensor's monotonic clock; None without a clock. Raises UserFault("sensor_revoked" | "sensor_idle"
    (no session uses it) | "sensor_clock_back" | "sensor_clock_stands" | "laps_too_many") and the faults of
    :func:`~races.timing.services.checks.require_driven_in_time`.
    """
    known = Crossing.objects.filter(sensor=sensor, boot=boot, number=number).select_related("session", "lap").first()
    if known is not None:
        return Taken(known.verdict, known.session, known.lap, again=True)
    running = TimedSession.objects.filter(sensor=sensor, ended_at=None, discarded_at=None).select_related("entry")
    session = running.first()
    if session is None:
        raise UserFault("sensor_idle")
    entry = lock_entry(session.entry_id)
    fresh = TimingSensor.objects.select_for_update().get(pk=sensor.pk)
    if fresh.revoked_at is not None:
        raise UserFault("sensor_revoked", when=moment(fresh.revoked_at))
    session = running.filter(pk=session.pk).first()
    if session is None:
        raise UserFault("sensor_idle")
    session.entry, session.race = entry, entry.race
    require_driven_in_time(entry.race, session.started_at, now)
    known = Crossing.objects.filter(sensor=sensor, boot=boot, number=number).select_related("lap").first()
    if known is not None:
        return Taken(known.verdict, session, known.lap, again=True)
    verdict, time_ms = _verdict(session, boot, at_ms, now)
    lap = None
    if verdict == CrossingVerdict.LAP:
        lap = _measured(session, f"{sensor.pk}:{boot}:{number}", time_ms)
    Crossing.objects.create(
        session=session,
        sensor=sensor,
        boot=boot,
        number=number,
        at_ms=at_ms,
        received_at=now,
        verdict=verdict,
        lap=lap,
    )
    TimingSensor.objects.filter(pk=sensor.pk).update(seen_at=now)
    if lap is not None:
        if now >= session.started_at + timedelta(seconds=entry.race.session_s):
            session.ended_at = now
            TimedSession.objects.filter(pk=session.pk).update(ended_at=now)
            publish_ended(session, now)
        settle(entry.race, [entry], now)
    return Taken(verdict, session, lap)


def _verdict(session: TimedSession, boot: str, at_ms: int | None, now: datetime) -> tuple[CrossingVerdict, int]:
    """What a new crossing is, and the milliseconds since the one before that counted."""
    taken = Crossing.objects.filter(session=session, boot=boot, at_ms__isnull=at_ms is None)
    before = taken.exclude(verdict=CrossingVerdict.BOUNCE).order_by("-number").first()
    if before is None:  # also after a restart of the sensor: its new clock cannot time the lap in progress
        return CrossingVerdict.START, 0
    received_ms = int((now - before.received_at).total_seconds() * 1000)
    passed = received_ms if at_ms is None or before.at_ms is None else at_ms - before.at_ms
    if passed < 0:
        raise UserFault("sensor_clock_back", ms=-passed)
    if passed == 0 and received_ms >= session.race.minimum_lap_ms:
        raise UserFault("sensor_clock_stands", seconds=received_ms // 1000)
    if passed < session.race.minimum_lap_ms:
        return CrossingVerdict.BOUNCE, passed
    return (CrossingVerdict.START, 0) if passed > LONGEST_LAP_MS else (CrossingVerdict.LAP, passed)


def _measured(session: TimedSession, name: str, time_ms: int) -> MeasuredLap:
    last = session.laps.order_by("-number").first()
    number = last.number + 1 if last else 1
    if number > MOST_LAPS:
        raise UserFault("laps_too_many", most=MOST_LAPS)
    lap = uuid.uuid5(session.pk, name)
    return MeasuredLap.objects.create(id=lap, session=session, number=number, time_ms=time_ms)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
