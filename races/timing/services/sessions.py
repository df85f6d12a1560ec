"""Upload of sessions from timing devices, and corrections of laps. Devices assign the ids, so a repeated upload changes
nothing."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from uuid import UUID

from django.db import transaction
from django.db.models import F
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.events import record
from paddock.errors import UserFault

from ...entries.services.locks import lock_entries, lock_entry, use_up_one
from ...entries.services.standings import work_out_standings
from ...events import RACE_TIMED, of_race, record_board
from ...models import Entry, LapCorrection, MeasuredLap, Race, RaceState, Source, TimedSession, TimingSensor
from ...models.race import LONGEST_LAP_MS
from ...signals import board_changed
from . import checks
from .guests import clean_name, guest_of

STORED = tuple(each.name for each in fields(checks.SentLap) if each.name != "wall_ms")


@dataclass(frozen=True)
class SentSession:
    """A session as the timekeeper's device keeps it. ``started_at``: by the server's clock, estimated.

    ``racer``: the alias of a racer in the race; or ``guest``: the id and name of a driver without an account.
    ``sensor``: the number of the sensor that measures the laps; of the laps sent only off tracks, resets and validity
    are then read. ``start_known``: false for a file without a start.
    """

    id: UUID
    revision: int
    started_at: datetime
    laps: Sequence[checks.SentLap] = ()
    racer: str = ""
    guest: tuple[UUID, str] | None = None
    car: str = ""
    ended: bool = False
    discarded: bool = False
    sensor: int | None = None
    source: str = Source.HAND
    start_known: bool = True


@audited("laps.timed", _("Laps timed"))
@transaction.atomic
def carry_over(*, race: Race, by: Racer, sent: SentSession, now: datetime) -> TimedSession | None:
    """Create or update a session atomically. None for a session discarded before its first upload.

    Raises UserFault("race_not_physical" | "timing_not_yours" | "timing_id_taken" | "timing_racer_unknown" |
    "entry_withdrawn" | "entry_removed" | "sessions_used_up" | "sessions_overlap" | "sensor_unknown" |
    "sensor_busy"), and as :func:`~.checks.require_driven_in_time` and :func:`~.checks.check_laps`.
    """
    checks.require_timekeeper(race, by)
    known = TimedSession.objects.filter(pk=sent.id).first()
    if known is not None and known.race_id != race.pk:
        raise UserFault("timing_id_taken")
    if known is not None and known.revision >= sent.revision:
        return known
    if known is None and sent.discarded:
        return None
    started_at = sent.started_at if known is None else known.started_at
    checks.require_driven_in_time(race, started_at, now, at_once=sent.source != Source.FILE)
    if sent.sensor is None:
        checks.check_laps(race, sent.laps, in_session=sent.source == Source.HAND)
    locked, session = _locked(race, sent, now, known)
    entry = _timed_entry(race, sent, now, session)
    if entry.pk not in locked or (session is not None and session.entry_id not in locked):
        # somebody took the guest's laps over while this waited for the locks, or brought the session of another racer
        locked, session = _locked(race, sent, now, session)
        entry = _timed_entry(race, sent, now, session)
    entry = locked[entry.pk]
    if session is not None and session.revision >= sent.revision:
        return session
    sensor = _sensor(entry.race, sent, session, now)
    if session is None or session.entry_id != entry.pk or sent.source == Source.FILE:
        _refuse_overlap(entry, sent, started_at)
    if session is None:
        session = _new(entry, sent, sensor, by, now)
    elif session.entry_id != entry.pk:
        _move(session, locked[session.entry_id], entry)
    ends = sent.ended and session.ended_at is None and not sent.discarded
    session.revision, session.car = sent.revision, clean_name(sent.car) if sent.car.strip() else ""
    session.ended_at = (session.ended_at or now) if sent.ended else None
    if sent.discarded and session.discarded_at is None:
        session.discarded_at = now
        Entry.objects.filter(pk=entry.pk, submission_count__gt=0).update(submission_count=F("submission_count") - 1)
    session.save()
    if session.sensor_id is None:
        _write_laps(session, sent.laps)
    else:
        _mark_laps(session, sent.laps)
    settle(entry.race, list(locked.values()), now)
    if ends:
        publish_ended(session, now)
    return session


def settle(race: Race, entries: Sequence[Entry], now: datetime) -> None:
    """Recompute the standings of these locked entries after changes to their laps, and notify the board's followers."""
    for entry in entries:
        entry.refresh_from_db(fields=["submission_count", "last_number"])
    work_out_standings(race, entries)
    record_board(race)
    if race.state_at(now) == RaceState.CLOSED:
        board_changed.send(sender=Race, race=race, now=now)


def publish_ended(session: TimedSession, now: datetime) -> None:
    """Notify the racer, webhooks and the season of a session's end, once."""
    by, key = session.entry.racer_id, str(session.pk)
    record(RACE_TIMED, at=now, **of_race(session.race), racer=by, session=key, once=key)


def _locked(
    race: Race, sent: SentSession, now: datetime, known: TimedSession | None
) -> tuple[dict[int, Entry], TimedSession | None]:
    """The entries that a session concerns, and the session as it is under their locks: it may have come by another way
    meanwhile."""
    numbers = {_timed_entry(race, sent, now, known).pk} | ({known.entry_id} if known is not None else set())
    locked = {one.pk: one for one in lock_entries(numbers)}
    return locked, TimedSession.objects.select_for_update().filter(pk=sent.id).first()


def _timed_entry(race: Race, sent: SentSession, now: datetime, known: TimedSession | None) -> Entry:
    if sent.guest is not None:
        id, name = sent.guest
        before = known.entry_id if known is not None else None
        entry = guest_of(race=race, id=id, name=name, now=now, before=before).entry
    else:
        found = Entry.objects.filter(race=race, racer__alias__iexact=sent.racer, is_baseline=False).first()
        if found is None:
            raise UserFault("timing_racer_unknown", racer=sent.racer[:64])
        entry = found
    if entry.is_withdrawn:
        raise UserFault("entry_removed" if entry.removed_at else "entry_withdrawn")
    return entry


def _sensor(race: Race, sent: SentSession, session: TimedSession | None, now: datetime) -> TimingSensor | None:
    if sent.sensor is None:
        return None
    found = TimingSensor.objects.select_for_update().filter(race=race, pk=sent.sensor)
    sensor = found.first()
    if sensor is None or (sensor.revoked_at is not None and session is None):
        raise UserFault("sensor_unknown")
    running = TimedSession.objects.filter(sensor=sensor, ended_at=None, discarded_at=None).exclude(pk=sent.id)
    # whose timekeeper has gone without a word
    gone = timedelta(seconds=race.session_s, milliseconds=LONGEST_LAP_MS)
    running.filter(started_at__lt=now - gone).update(ended_at=now)
    if not sent.ended and not sent.discarded and running.exists():
        raise UserFault("sensor_busy", sensor=sensor.name)
    return sensor


def _refuse_overlap(entry: Entry, sent: SentSession, started_at: datetime) -> None:
    """Raises UserFault("sessions_overlap") for a racer who drove another session at that time."""
    if sent.discarded or not sent.start_known:
        return
    race = entry.race
    ends_at = started_at + _extent(race, [lap.time_ms for lap in sent.laps], ended=sent.ended)
    others = TimedSession.objects.filter(entry=entry, discarded_at=None, started_at__lt=ends_at).exclude(pk=sent.id)
    for other in others.prefetch_related("laps"):
        # the start of a session from a file that states none is the time of the import
        guessed = {other.received_at, race.opens_at, race.closes_at - timedelta(milliseconds=1)}
        if other.source == Source.FILE and other.started_at in guessed:
            continue
        driven = [lap.time_ms for lap in other.laps.all()]
        if other.started_at + _extent(race, driven, ended=other.ended_at is not None) > started_at:
            raise UserFault("sessions_overlap", racer=entry.guest_name or entry.racer.alias, number=other.number)


def _extent(race: Race, times_ms: Sequence[int], *, ended: bool) -> timedelta:
    """From the start of a session to the end of its last lap; of one that still runs at least the session's length."""
    return timedelta(milliseconds=max(sum(times_ms), 0 if ended else race.session_s * 1000))


def _new(entry: Entry, sent: SentSession, sensor: TimingSensor | None, by: Racer | None, now: datetime) -> TimedSession:
    use_up_one(entry, "sessions_used_up")
    session = TimedSession(
        id=sent.id,
        race=entry.race,
        entry=entry,
        number=entry.last_number,
        revision=sent.revision,
        source=Source.SENSOR if sensor else sent.source,
        sensor=sensor,
        started_at=sent.started_at,
        received_at=now,
        model=entry.model,
        timekeeper=by,
    )
    session.save(force_insert=True)
    return session


def _move(session: TimedSession, before: Entry, entry: Entry) -> None:
    """The timekeeper had chosen the wrong racer."""
    counted = session.discarded_at is None
    Entry.objects.filter(pk=entry.pk).update(
        submission_count=F("submission_count") + int(counted), last_number=F("last_number") + 1
    )
    if counted:
        Entry.objects.filter(pk=before.pk).update(submission_count=F("submission_count") - 1)
    entry.refresh_from_db(fields=["last_number"])
    session.entry, session.number, session.model = entry, entry.last_number, entry.model


def _write_laps(session: TimedSession, laps: Sequence[checks.SentLap]) -> None:
    """Store the laps as sent, except for corrected ones."""
    ids = [lap.id for lap in laps]
    if MeasuredLap.objects.filter(pk__in=ids).exclude(session=session).exists():
        raise UserFault("timing_id_taken")
    kept = {lap.pk: lap for lap in session.laps.filter(corrected=True)}
    session.laps.filter(corrected=False).delete()
    taken = {lap.number for lap in kept.values()}
    MeasuredLap.objects.bulk_create(
        MeasuredLap(session=session, **{name: getattr(lap, name) for name in STORED})
        for lap in laps
        if lap.id not in kept and lap.number not in taken
    )


def _mark_laps(session: TimedSession, laps: Sequence[checks.SentLap]) -> None:
    """What the timekeeper saw of laps that the sensor has measured."""
    for lap in laps:
        session.laps.filter(pk=lap.id, corrected=False).update(
            off_tracks=lap.off_tracks, resets=lap.resets, valid=lap.valid
        )


FIELDS = ("time_ms", "off_tracks", "resets", "valid")
_LONGEST = 255


@audited("laps.corrected", _("Lap corrected"), target="lap")
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
    """Change the given values of a lap or invalidate it; the old values stay in the log. None keeps a value. Raises
    UserFault("correction_needs_a_reason" | "correction_changes_nothing" | "lap_faults") and the faults of
    :func:`~races.timing.services.checks.check_time` and :func:`~races.timing.services.checks.require_may_correct`."""
    race = lap.session.race
    checks.require_may_correct(race, by, now)
    reason = " ".join(reason.split())[:_LONGEST]
    if not reason:
        raise UserFault("correction_needs_a_reason")
    entry = lock_entry(lap.session.entry_id)
    lap = MeasuredLap.objects.select_for_update().get(pk=lap.pk)
    before = {name: getattr(lap, name) for name in FIELDS}
    sent = {"time_ms": time_ms, "off_tracks": off_tracks, "resets": resets, "valid": valid}
    after = before | {name: value for name, value in sent.items() if value is not None}
    if after == before:
        raise UserFault("correction_changes_nothing")
    checks.check_time(race, lap.number, after["time_ms"], valid=after["valid"])
    if not all(0 <= after[name] <= checks.MOST_FAULTS for name in ("off_tracks", "resets")):
        raise UserFault("lap_faults", lap=lap.number, most=checks.MOST_FAULTS)
    for name, value in after.items():
        setattr(lap, name, value)
    lap.corrected = True
    lap.save(update_fields=[*FIELDS, "corrected"])
    made = LapCorrection.objects.create(lap=lap, by=by, at=now, reason=reason, before=before, after=after)
    settle(entry.race, [entry], now)
    return made
