"""Getting into a race and out of it."""

from collections.abc import Collection, Iterable
from datetime import datetime

from django.db import transaction
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.groups.selectors import is_in
from accounts.models import Racer
from core.audit.recording import audited
from core.database.after_commit import after_commit
from evaluation.models import Evaluation
from paddock.errors import UserFault

from ...events import record_board
from ...models import Duel, Entry, Race, RaceState, Visibility
from ...signals import board_changed
from ..eligibility import check_eligible
from ..hooks import report_departure
from ..selectors.visibility import can_organise, race_invited_to
from ..terms import accept_terms
from ..time_checks import require_not_over
from .cars import settle_after_commit
from .locks import lock_entries, lock_entry, stop_after_commit
from .standings import forget_fastest, note_fastest


@transaction.atomic
def enter_race(*, race: Race, racer: Racer, now: datetime, terms: int | None = None, invited: bool = False) -> Entry:
    """Enter a racer in a race that is not over; a withdrawn racer returns with all results.

    ``terms``: the accepted version of the race's terms; ``invited``: by a link or in person, as the caller has checked.
    Raises UserFault("race_needs_invitation" | "entry_removed" | "race_closed" | "race_cancelled" | "race_terms") and
    the faults of eligibility checks.
    """
    require_not_over(race, now)
    entry = race.entries.filter(racer=racer).first()
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
    lock_entry(entry.pk)
    if Entry.objects.filter(pk=entry.pk, removed_at=None, withdrawn_at__isnull=False).update(withdrawn_at=None):
        entry.refresh_from_db(fields=["withdrawn_at"])
        _came_back(entry)
    return entry


@transaction.atomic
def accept_invitation(*, token: str, racer: Racer, now: datetime, terms: int | None = None) -> Entry:
    """Enter the race of an invitation link. Raises UserFault("invitation_unknown"), else as :func:`enter_race`."""
    race = race_invited_to(token)
    if race is None:
        raise UserFault("invitation_unknown")
    return enter_race(race=race, racer=racer, now=now, terms=terms, invited=True)


@transaction.atomic
def withdraw(*, entry: Entry, now: datetime) -> Entry:
    """Take a racer off the board; results are kept. Raises UserFault("race_closed" | "race_cancelled")."""
    require_not_over(entry.race, now)
    withdrawn = lock_entry(entry.pk).withdrawn_at is None
    if withdrawn:
        Entry.objects.filter(pk=entry.pk).update(withdrawn_at=now)
    entry.refresh_from_db()
    if withdrawn:
        _left(entry, now)
    return entry


@audited("entry.removed", _("Racer removed from a race"), target="entry")
@transaction.atomic
def remove_entry(*, entry: Entry, by: Racer, now: datetime, reason: str = "") -> Entry:
    """Take a racer out of a race for good, also after it has closed. Raises UserFault("race_not_yours")."""
    if not can_organise(by, entry.race):
        raise UserFault("race_not_yours")
    limit = Entry._meta.get_field("removal_reason").max_length
    entry = lock_entry(entry.pk)
    if entry.removed_at is None:
        _remove(entry, now, " ".join(reason.split())[:limit])
        board_changed.send(sender=Race, race=entry.race, now=now)
    return entry


@audited("entry.restored", _("Racer let back into a race"), target="entry")
@transaction.atomic
def restore_entry(*, entry: Entry, by: Racer, now: datetime | None = None) -> Entry:
    """Restore a removed racer. Raises UserFault("race_not_yours") unless ``by`` organises the race."""
    if not can_organise(by, entry.race):
        raise UserFault("race_not_yours")
    entry = lock_entry(entry.pk)
    if entry.removed_at is not None:
        _restore(entry)
        board_changed.send(sender=Race, race=entry.race, now=now or timezone.now())
    return entry


@transaction.atomic
def give_field(*, race: Race, racers: Collection[int], now: datetime, reason: str) -> None:
    """Enter exactly the racers with these ids in a race that is not over. Racers removed for this ``reason`` return,
    all others but house cars are removed for it; a racer who withdrew stays withdrawn."""
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
            _remove(entry, now, reason)


@transaction.atomic
def bring_back(entries: Iterable[Entry], *, reason: str) -> None:
    """Undo :func:`take_out` for those of these entries that were taken out for this reason."""
    for entry in lock_entries(entry.pk for entry in entries):
        if entry.removed_at is not None and entry.removal_reason == reason:
            _restore(entry)


def _remove(entry: Entry, now: datetime, reason: str) -> None:
    entry.removed_at, entry.withdrawn_at, entry.removal_reason = now, entry.withdrawn_at or now, reason
    entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
    _left(entry, now)


def _restore(entry: Entry) -> None:
    entry.removed_at, entry.withdrawn_at, entry.removal_reason = None, None, ""
    entry.save(update_fields=["removed_at", "withdrawn_at", "removal_reason"])
    _came_back(entry)


def _came_back(entry: Entry) -> None:
    note_fastest(entry)
    settle_after_commit(entry)
    record_board(entry.race)


def _left(entry: Entry, now: datetime) -> None:
    forget_fastest(entry)
    settle_after_commit(entry)
    runs = Q(submission__entry=entry) | Q(duel__in=Duel.objects.filter(cars__entry=entry))
    stop_after_commit(Evaluation.objects.filter(runs), now=now)
    after_commit(report_departure, entry, now)
    record_board(entry.race)
