"""Getting into a race and out of it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING

from django.db import transaction
from django.utils import timezone

from accounts.groups.selectors import is_in
from paddock.errors import UserFault

from ..eligibility import check_eligible
from ..events import record_board
from ..models import Entry, LiveEvent, Race, RaceState, Visibility
from ..models.live import UNDER_WAY
from ..selectors.visibility import can_organise
from ..signals import board_changed
from .cars import settle_after_commit
from .gates import require_not_over
from .locks import lock_entries, lock_entry
from .standings import forget_fastest, note_fastest
from .stopping import stop_after_commit, stop_duels_after_commit
from .terms import accept_terms

if TYPE_CHECKING:
    from accounts.models import Racer


@transaction.atomic
def enter_race(*, race: Race, racer: Racer, now: datetime, terms: int | None = None) -> Entry:
    """Put a racer into a race that is not over; who is in stays in, who has withdrawn is back with all they drove.

    ``terms``: the version of the race's terms that the racer accepts. Raises UserFault("race_needs_invitation") for a
    race by invitation unless the racer is in it or holds it, "entry_removed", "race_closed", "race_cancelled",
    "race_terms" where others stand to be accepted, or what an eligibility check says.
    """
    return _enter(race, racer, now, invited=False, terms=terms)


@transaction.atomic
def accept_invitation(*, token: str, racer: Racer, now: datetime, terms: int | None = None) -> Entry:
    """Enter the race that an invitation link belongs to.

    Raises UserFault("invitation_unknown") for a link that was reset or never was, else as :func:`enter_race`.
    """
    race = Race.objects.filter(invitation=token, visibility=Visibility.INVITATION).first() if token else None
    if race is None:
        raise UserFault("invitation_unknown")
    return _enter(race, racer, now, invited=True, terms=terms)


@transaction.atomic
def enter_as_invited(*, race: Race, racer: Racer, now: datetime, terms: int | None = None) -> Entry:
    """Enter a race to which somebody who organises it has invited the racer in person: whoever calls has made sure of
    that. Raises as :func:`enter_race` does."""
    return _enter(race, racer, now, invited=True, terms=terms)


@transaction.atomic
def withdraw(*, entry: Entry, now: datetime) -> Entry:
    """Take a racer out of a race that is not over: off the board, what waits or drives is stopped, nothing is lost.

    Raises UserFault("race_closed" | "race_cancelled").
    """
    require_not_over(entry.race, now)
    withdrawn = lock_entry(entry).withdrawn_at is None
    if withdrawn:
        Entry.objects.filter(pk=entry.pk).update(withdrawn_at=now)
    entry.refresh_from_db()
    if withdrawn:
        _left(entry, now)
    return entry


@transaction.atomic
def remove_entry(*, entry: Entry, by: Racer, now: datetime, reason: str = "") -> Entry:
    """Take a racer out of a race for good, also after it has closed; what they drove stays to be looked into.

    Raises UserFault("race_not_yours") unless ``by`` organises the race.
    """
    if not can_organise(by, entry.race):
        raise UserFault("race_not_yours")
    limit = Entry._meta.get_field("removal_reason").max_length
    entry = lock_entry(entry)
    if entry.removed_at is None:
        entry.removed_at = now
        entry.withdrawn_at = entry.withdrawn_at or now
        entry.removal_reason = " ".join(reason.split())[:limit]
        entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
        _left(entry, now)
        board_changed.send(sender=Race, race=entry.race, now=now)
    return entry


@transaction.atomic
def restore_entry(*, entry: Entry, by: Racer, now: datetime | None = None) -> Entry:
    """Put a removed racer back on the board. Raises UserFault("race_not_yours") unless ``by`` organises the race."""
    if not can_organise(by, entry.race):
        raise UserFault("race_not_yours")
    entry = lock_entry(entry)
    if entry.removed_at is not None:
        entry.removed_at = entry.withdrawn_at = None
        entry.removal_reason = ""
        entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
        _came_back(entry)
        board_changed.send(sender=Race, race=entry.race, now=now or timezone.now())
    return entry


@transaction.atomic
def give_field(*, race: Race, racers: Collection[int], now: datetime, reason: str) -> None:
    """Enter exactly the racers with these ids in a race, as far as a field given from outside goes.

    Who is not in gets an entry, who was taken out for this ``reason`` comes back, and everybody else in the race but
    house cars is taken out for it. A racer who withdrew on their own stays so. Does nothing once the race is over.
    """
    if race.state_at(now) not in (RaceState.UPCOMING, RaceState.OPEN):
        return
    wanted = set(racers)
    inside = Entry.objects.filter(race=race, is_baseline=False).values_list("pk", flat=True)
    entries = {one.racer_id: one for one in lock_entries(inside)}
    Entry.objects.bulk_create(
        [Entry(race=race, racer_id=racer, entered_at=now) for racer in sorted(wanted - entries.keys())],
        ignore_conflicts=True,
    )
    take_out([one for racer, one in entries.items() if racer not in wanted], now=now, reason=reason)
    bring_back([one for racer, one in entries.items() if racer in wanted], reason=reason)


@transaction.atomic
def take_out(entries: Iterable[Entry], *, now: datetime, reason: str) -> None:
    """Take these entries out of their races; those that have left already stay as they are."""
    for entry in lock_entries(entry.pk for entry in entries):
        if entry.removed_at is None:
            entry.removed_at, entry.withdrawn_at = now, entry.withdrawn_at or now
            entry.removal_reason = reason
            entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
            _left(entry, now)


@transaction.atomic
def bring_back(entries: Iterable[Entry], *, reason: str) -> None:
    """Undo :func:`take_out` for those of these entries that were taken out for this reason."""
    for entry in lock_entries(entry.pk for entry in entries):
        if entry.removed_at is not None and entry.removal_reason == reason:
            entry.removed_at = entry.withdrawn_at = None
            entry.removal_reason = ""
            entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
            _came_back(entry)


def _enter(race: Race, racer: Racer, now: datetime, *, invited: bool, terms: int | None) -> Entry:
    require_not_over(race, now)
    entry = Entry.objects.filter(race=race, racer=racer).select_related("race", "racer").first()
    if entry is not None and entry.removed_at is not None:
        raise UserFault("entry_removed")
    if entry is not None and not entry.is_withdrawn:
        if terms is not None:
            accept_terms(entry, race, accepted=terms, now=now)
        return entry
    invited = invited or can_organise(racer, race) or (race.group_id is not None and is_in(racer, race.group_id))
    if entry is None and race.visibility == Visibility.INVITATION and not invited:
        raise UserFault("race_needs_invitation")
    check_eligible(race, racer, now)
    if entry is None:
        entry, _ = Entry.objects.get_or_create(
            race=race, racer=racer, defaults={"entered_at": now, "is_baseline": racer.is_house}
        )
    accept_terms(entry, race, accepted=terms, now=now)
    if not entry.is_withdrawn:
        return entry
    lock_entry(entry)
    if Entry.objects.filter(pk=entry.pk, removed_at=None, withdrawn_at__isnull=False).update(withdrawn_at=None):
        entry.refresh_from_db(fields=["withdrawn_at"])
        _came_back(entry)
    return entry


def _came_back(entry: Entry) -> None:
    note_fastest(entry)
    settle_after_commit(entry)
    record_board(entry.race)


def _left(entry: Entry, now: datetime) -> None:
    forget_fastest(entry)
    settle_after_commit(entry)
    stop_after_commit(entry.submissions.all(), now=now)
    stop_duels_after_commit(entry, now=now)
    transaction.on_commit(partial(_leave_live, entry, now), robust=True)
    record_board(entry.race)


def _leave_live(entry: Entry, now: datetime) -> None:
    """Take what is still to come of them in a live event out of its running order. If it fails, the clock does it."""
    from .live.sealing import prepare_ahead  # it knows entries, too

    for event in LiveEvent.objects.filter(race=entry.race_id, state__in=UNDER_WAY):
        prepare_ahead(event=event, now=now)
