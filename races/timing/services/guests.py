"""Guests: a placeholder entry holds the laps of a driver without an account until a racer takes them over."""

from datetime import datetime
from uuid import UUID

from django.db import transaction
from django.utils.crypto import get_random_string
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.validators import without_invisible
from paddock.errors import UserFault

from ...entries.eligibility import check_eligible
from ...entries.services.locks import lock_entries
from ...entries.services.standings import work_out_standings
from ...events import record_board
from ...models import Entry, Guest, Race
from ...signals import board_changed
from .checks import require_may_correct, require_not_final, require_physical

LONGEST_NAME = 64
_EMAIL = "guest-{name}@record.invalid"


def clean_name(name: str) -> str:
    """A guest's name on one line. Raises UserFault("guest_name")."""
    name = without_invisible(name)
    if not name or len(name) > LONGEST_NAME or name[0] in "=+-@":  # a sheet would take it for a formula
        raise UserFault("guest_name", most=LONGEST_NAME)
    return name


def guest_of(*, race: Race, id: UUID, name: str, now: datetime, before: int | None = None) -> Guest:
    """Get the guest with this id, or create it in the caller's transaction. ``before``: the primary key of an entry
    that the caller will lock as well. Raises UserFault("guest_name" | "guest_is_racer" | "timing_id_taken")."""
    if (found := _known(race, id)) is not None:
        return found
    name = clean_name(name)
    if Entry.objects.filter(race=race, racer__alias__iexact=name, is_baseline=False).exists():
        raise UserFault("guest_is_racer", name=name)
    # locked in their order before a new entry is counted (races.entries.services.locks); when two devices
    # bring one guest at once, the second finds the row of the first
    if not lock_entries([] if before is None else [before]):
        Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    if (found := _known(race, id)) is not None:
        return found
    code = get_random_string(10, "abcdefghjkmnpqrstuvwxyz23456789")
    racer = Racer(
        alias=f"guest-{code}",
        email=_EMAIL.format(name=id.hex),
        password="!",  # none can be right
        is_active=False,
        joined_at=now,
        record_id=f"guest:{id}",
        guest_name=name,
    )
    racer.save(force_insert=True)
    entry = Entry.objects.create(race=race, racer=racer, entered_at=now, guest_name=name)
    return Guest.objects.create(id=id, race=race, entry=entry, name=name, made_at=now)


def _known(race: Race, id: UUID) -> Guest | None:
    found = Guest.objects.filter(pk=id).select_related("entry__race", "entry__racer").first()
    if found is not None and found.race_id != race.pk:
        raise UserFault("timing_id_taken")
    return found


@audited("guest.linked", _("Guest's results given to a racer"))
def link_guest(*, guest: Guest, racer: Racer, by: Racer, now: datetime) -> Entry:
    """Transfer a guest's sessions to a racer. Needs the right to correct laps. Raises UserFault("guest_linked" |
    "entry_removed") and the faults of the eligibility check and of
    :func:`~races.timing.services.checks.require_may_correct`."""
    require_may_correct(guest.race, by, now)
    return _link(guest, racer, now)


def claim_guest(*, claim: str, racer: Racer, now: datetime) -> Entry:
    """Take over a guest's laps with the secret from the organiser. Raises UserFault("guest_unknown"), else as
    :func:`link_guest`."""
    guest = Guest.objects.filter(claim=claim).select_related("race", "entry").first() if claim else None
    if guest is None:
        raise UserFault("guest_unknown")
    require_physical(guest.race)
    require_not_final(guest.race, now)
    return _link(guest, racer, now)


@transaction.atomic
def _link(guest: Guest, racer: Racer, now: datetime) -> Entry:
    race = guest.race
    if racer.record_id is not None or racer.is_house or not racer.is_active:
        raise UserFault("timing_racer_unknown", racer=racer.alias)
    check_eligible(race, racer, now)
    known = Entry.objects.filter(race=race, racer=racer).first()
    locked = {one.pk: one for one in lock_entries([guest.entry_id, *([known.pk] if known else [])])}
    # under the locks: of two who claim the same laps one is the first
    fresh = Guest.objects.select_for_update().get(pk=guest.pk)
    if fresh.linked_at is not None:
        raise UserFault("guest_linked", guest=fresh.name)
    if known is None:  # not before the locks: counting a new entry comes last
        known, _ = Entry.objects.get_or_create(race=race, racer=racer, defaults={"entered_at": now})
        locked |= {one.pk: one for one in lock_entries([known.pk])}
    source, target = locked[fresh.entry_id], locked[known.pk]
    if target.removed_at is not None:
        raise UserFault("entry_removed")
    for session in source.timed_sessions.order_by("number"):
        target.last_number += 1
        target.submission_count += session.discarded_at is None
        session.entry, session.number = target, target.last_number
        session.save(update_fields=["entry", "number"])
    target.withdrawn_at = None
    target.save(update_fields=["last_number", "submission_count", "withdrawn_at"])
    fresh.entry, fresh.linked_at = target, now
    fresh.save(update_fields=["entry", "linked_at"])
    stand_in = source.racer
    source.delete()
    if not stand_in.entries.exists():
        stand_in.delete()
    work_out_standings(target.race, [target])
    record_board(target.race)
    if target.race.state_at(now) == "closed":
        board_changed.send(sender=Race, race=target.race, now=now)
    return target
