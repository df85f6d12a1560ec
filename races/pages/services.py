"""Creating, changing and cancelling races."""

import hashlib
from collections.abc import Iterable
from datetime import datetime, timedelta, tzinfo
from functools import partial
from typing import Any

from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import F
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.text import slugify
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from accounts.quotas import limit_of, used_by
from core.audit.recording import audited
from core.database.after_commit import after_commit
from core.database.columns import copied_values
from core.database.locks import hold
from core.events import record
from evaluation.models import Evaluation
from evaluation.running.queue.turns import reschedule
from paddock.errors import UserFault

from ..entries.services.locks import stop_after_commit
from ..entries.terms import keep_terms, one_form
from ..entries.time_checks import require_not_over, require_open
from ..errors import RaceRefused, problem
from ..events import LIVE_CHANGED, RACE_CANCELLED, of_race
from ..models import LiveEvent, Opponents, Race, RaceKind, Submission, TimedSession, new_invitation
from ..models.race import RESERVED_SLUGS
from ..quotas import RACES
from ..rules.validation import EDITABLE_FIELDS, check_race, hold_above, stored_value

_COPIED = tuple(name for name in EDITABLE_FIELDS if name not in ("opens_at", "closes_at"))


@audited("race.created", _("Race created"), by="organiser")
@transaction.atomic
def create_community_race(*, organiser: Racer, now: datetime, **fields: Any) -> Race:
    """Create a racer's own race. ``fields``: those in ``EDITABLE_FIELDS`` except the division.

    Raises RaceRefused, UserFault("race_limit") above the quota of unfinished races (not for admins and the house),
    TypeError."""
    _refuse_unknown(fields, but=("division",))
    if not (organiser.is_staff or organiser.is_house):
        hold(organiser)
        limit = limit_of(organiser, RACES.name)
        if used_by(organiser, RACES.name, now) >= limit:
            raise UserFault("race_limit", limit=limit)
    return _create(Race(kind=RaceKind.COMMUNITY, organiser=organiser, **fields), now)


@audited("race.created", _("Race created"))
@transaction.atomic
def create_league_race(*, now: datetime, **fields: Any) -> Race:
    """Create a race of the league, by default with unlimited submissions. ``fields``: ``slug`` and those in
    ``EDITABLE_FIELDS``. Raises RaceRefused, TypeError."""
    _refuse_unknown(fields, also=("slug",))
    return _create(Race(kind=RaceKind.LEAGUE, **{"max_submissions": None, **fields}), now)


def edition_of(race: Race) -> str:
    """A hash of a race's changeable fields in 16 characters."""
    values = [str(stored_value(race, name)) for name in EDITABLE_FIELDS]
    return hashlib.sha256(repr(values).encode()).hexdigest()[:16]


@audited("race.changed", _("Race changed"), target="race")
@transaction.atomic
def edit_race(*, race: Race, now: datetime, edition: str | None = None, **changes: Any) -> Race:
    """Change fields in ``EDITABLE_FIELDS``. ``edition``: the :func:`edition_of` that the changes are based on; None
    overwrites.

    Fields that affect results are fixed from the first submission, the opening from the opening on, and all but texts
    from the closing. Raises UserFault("race_changed_meanwhile"), RaceRefused, TypeError."""
    _refuse_unknown(changes)
    hold_above(race)
    before = Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    if edition is not None and edition != edition_of(before):
        raise UserFault("race_changed_meanwhile")
    after = Race.objects.get(pk=race.pk)
    for name, value in changes.items():
        setattr(after, name, one_form(value) if name == "terms" else value)
    check_race(after, now=now, before=before, submissions=has_submissions(before))
    after.save(update_fields=Race.columns_of(changes))
    if "terms" in changes:
        keep_terms(after, now)
    if after.closes_at != before.closes_at:
        _reschedule(race, after.closes_at)
    race.refresh_from_db()
    return race


@audited("race.cancelled", _("Race cancelled"), target="race")
@transaction.atomic
def cancel_race(*, race: Race, reason: str, now: datetime) -> Race:
    """Cancel an unfinished race and stop its cars; entries and results remain. Raises
    RaceRefused("cancel_needs_a_reason"), UserFault("race_closed" | "race_cancelled")."""
    reason = " ".join(reason.split())
    limit = Race._meta.get_field("cancel_reason").max_length
    if not reason:
        raise RaceRefused(ValidationError({"cancel_reason": problem("cancel_needs_a_reason")}))
    locked = Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    require_not_over(locked, now)
    locked.cancelled_at, locked.cancel_reason = now, reason[:limit]
    locked.save(update_fields=["cancelled_at", "cancel_reason"])
    record(RACE_CANCELLED, at=now, **of_race(race), reason=reason[:limit])
    stop_after_commit(Evaluation.objects.filter(submission__entry__race=race), now=now)
    race.refresh_from_db()
    return race


@audited("race.closed", _("Race closed before its time"), target="race")
@transaction.atomic
def close_race(*, race: Race, now: datetime, duels_live_only: bool = False) -> Race:
    """Close an open race now; queued and driving cars still count. ``duels_live_only``: its duels wait for a live
    event.

    Raises UserFault("race_not_open_yet" | "race_closed" | "race_cancelled" | "race_recorded")."""
    hold_above(race)
    locked = Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    require_open(locked, now)
    if now == locked.opens_at:  # a race lasts for a moment at least
        now += timedelta(milliseconds=1)
    Race.objects.filter(pk=race.pk).update(closes_at=now)
    if duels_live_only and locked.opponents == Opponents.MODELS:
        locked.duels_live_only = True
        locked.save(update_fields=Race.columns_of(["duels_live_only"]))
    _reschedule(race, now)
    race.refresh_from_db()
    return race


@audited("race.link_replaced", _("Invitation link replaced"), target="race")
def reset_invitation(*, race: Race) -> Race:
    """Replace a race's invitation link: the old one stops working, its entries stay."""
    race.invitation = new_invitation()
    race.save(update_fields=["invitation"])
    return race


@audited("race.spectator_link_replaced", _("Spectators' link replaced"), target="race")
@transaction.atomic
def renew_spectator_link(*, race: Race, now: datetime) -> Race:
    """Give a race another spectators' link. The old one opens nothing any more, and streams opened with it end."""
    Race.objects.filter(pk=race.pk).update(spectator_edition=F("spectator_edition") + 1)
    race.refresh_from_db(fields=["spectator_edition"])
    version = LiveEvent.objects.filter(race=race).values_list("version", flat=True).first()
    record(LIVE_CHANGED, at=now, **of_race(race), version=version or 0)
    return race


@audited("race.copied", _("Race copied"))
@transaction.atomic
def clone_race(*, race: Race, now: datetime, months: int = 1) -> Race:
    """The same race ``months`` calendar months later. Raises RaceRefused for a time that has passed."""
    clone = Race(kind=race.kind, organiser=race.organiser, **copied_values(race, _COPIED))
    clone.opens_at = add_months(race.opens_at, months)
    clone.closes_at = add_months(race.closes_at, months)
    return _create(clone, now)


def add_months(time: datetime, months: int, zone: tzinfo | None = None) -> datetime:
    """The same wall-clock time of ``zone`` (the site's) in another month; the day is cut to that month's length."""
    zone = zone or timezone.get_default_timezone()
    local = time.astimezone(zone)
    index = local.year * 12 + local.month - 1 + months
    year, month = index // 12, index % 12 + 1
    first_of_next = datetime(year + month // 12, month % 12 + 1, 1)
    days = (first_of_next - datetime(year, month, 1)).days
    return local.replace(year=year, month=month, day=min(local.day, days), fold=0)


def has_submissions(race: Race) -> bool:
    """Whether anybody has submitted a car or was timed, so that the rules stand."""
    return (
        Submission.objects.filter(entry__race=race).exists()
        or TimedSession.objects.filter(race=race, discarded_at=None).exists()
    )


def free_slug(name: str, *, fallback: str = "race") -> str:
    """An address for a race of this name that no race has."""
    limit = Race._meta.get_field("slug").max_length - 8
    base = slugify(name)[:limit].strip("-") or fallback
    slug = base if slugify(name) and base not in RESERVED_SLUGS else f"{base}-{_few_letters()}"
    while Race.objects.filter(slug=slug).exists():
        slug = f"{base}-{_few_letters()}"
    return slug


def _create(race: Race, now: datetime) -> Race:
    race.name = " ".join(race.name.split())
    race.terms = one_form(race.terms)
    race.slug = race.slug or free_slug(race.name)
    race.created_at = now
    check_race(race, now=now)
    race.save(force_insert=True)
    keep_terms(race, now)
    return race


def _reschedule(race: Race, closes_at: datetime) -> None:
    """Reschedule after the commit: the end of an evaluation needs the race's lock, which is held here."""
    cars = Evaluation.objects.filter(submission__entry__race=race)
    after_commit(reschedule, evaluations=cars, closes_at=closes_at)


def _refuse_unknown(options: Iterable[str], *, but: Iterable[str] = (), also: Iterable[str] = ()) -> None:
    unknown = set(options) - set(EDITABLE_FIELDS).difference(but).union(also)
    if unknown:
        raise TypeError(f"not a field of a race that can be set: {', '.join(sorted(unknown))}")


_few_letters = partial(get_random_string, 5, "abcdefghjkmnpqrstuvwxyz23456789")
