"""Making, changing and cancelling races."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from datetime import datetime, timedelta, tzinfo
from functools import partial
from typing import TYPE_CHECKING, Any

from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import F
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.text import slugify

from accounts.quotas import limit_of, used_by
from core.events import record
from core.locks import hold
from evaluation.models import Evaluation
from evaluation.services import reschedule
from paddock.errors import UserFault
from tracks.models import Track

from ..errors import RaceRefused, problem
from ..events import LIVE_CHANGED, RACE_CANCELLED, of_race
from ..models import LiveEvent, Opponents, Race, RaceKind, Submission, TimedSession, new_invitation
from ..models.race import RESERVED_SLUGS
from ..quotas import RACES
from ..validation import EDITABLE_FIELDS, check_race, hold_above, stored_value
from .gates import require_not_over, require_open
from .stopping import stop_after_commit
from .terms import keep_terms, one_form

if TYPE_CHECKING:
    from accounts.models import Racer

_COPIED = tuple(name for name in EDITABLE_FIELDS if name not in ("opens_at", "closes_at"))


@transaction.atomic
def create_community_race(
    *, organiser: Racer, now: datetime, name: str, track: Track, opens_at: datetime, closes_at: datetime, **options: Any
) -> Race:
    """Make a racer's own race. ``options``: any other field in ``EDITABLE_FIELDS`` but the division.

    Raises RaceRefused (with all problems by field), UserFault("race_limit") above the racer's quota of
    races that are not over; admins and the house may hold any number. Raises TypeError for an option that no race has.
    """
    _refuse_unknown(options, but=("division",))
    if not (organiser.is_staff or organiser.is_house):
        hold(organiser)
        limit = limit_of(organiser, RACES.name)
        if used_by(organiser, RACES.name, now) >= limit:
            raise UserFault("race_limit", limit=limit)
    return _create(
        Race(
            kind=RaceKind.COMMUNITY,
            organiser=organiser,
            name=name,
            track=track,
            opens_at=opens_at,
            closes_at=closes_at,
            **options,
        ),
        now,
    )


@transaction.atomic
def create_league_race(
    *, now: datetime, division: str, name: str, track: Track, opens_at: datetime, closes_at: datetime, **options: Any
) -> Race:
    """Make a race of the league. ``options``: any other field in ``EDITABLE_FIELDS``, and ``slug``. Submissions are
    unlimited unless they say otherwise.

    Raises RaceRefused with all problems by field, TypeError for an option that no race has.
    """
    _refuse_unknown(options, also=("slug",))
    options.setdefault("max_submissions", None)
    race = Race(
        kind=RaceKind.LEAGUE,
        division=division,
        name=name,
        track=track,
        opens_at=opens_at,
        closes_at=closes_at,
        **options,
    )
    return _create(race, now)


def edition_of(race: Race) -> str:
    """What stands in all that may be changed of a race, in 16 characters: another after every change."""
    values = [str(stored_value(race, name)) for name in EDITABLE_FIELDS]
    return hashlib.sha256(repr(values).encode()).hexdigest()[:16]


@transaction.atomic
def edit_race(*, race: Race, now: datetime, edition: str | None = None, **changes: Any) -> Race:
    """Change a race: ``changes`` are any fields in ``EDITABLE_FIELDS``.

    ``edition``: what :func:`edition_of` said when the changes were thought of, so that nobody undoes what somebody else
    has changed since without having seen it; None to write over whatever stands. What moves a result is fixed from the
    first submission on, the opening time from the opening on, everything but name and description from the closing on.
    Raises UserFault("race_changed_meanwhile"), RaceRefused with all problems by field; TypeError for another field.
    """
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


@transaction.atomic
def cancel_race(*, race: Race, reason: str, now: datetime) -> Race:
    """Cancel a race that is not over yet; cars that wait or drive are stopped, entries and results stay to be read.

    Raises RaceRefused("cancel_needs_a_reason") on the field ``cancel_reason``, UserFault("race_closed" |
    "race_cancelled").
    """
    reason = " ".join(reason.split())
    limit = Race._meta.get_field("cancel_reason").max_length
    if not reason:
        raise RaceRefused(ValidationError({"cancel_reason": problem("cancel_needs_a_reason")}))
    locked = Race.objects.select_for_update(no_key=True).get(pk=race.pk)
    require_not_over(locked, now)
    Race.objects.filter(pk=race.pk).update(cancelled_at=now, cancel_reason=reason[:limit])
    record(RACE_CANCELLED, at=now, **of_race(race), reason=reason[:limit])
    stop_after_commit(Submission.objects.filter(entry__race=race), now=now)
    race.refresh_from_db()
    return race


@transaction.atomic
def close_race(*, race: Race, now: datetime, duels_live_only: bool = False) -> Race:
    """Close an open race now instead of at its time: no car can be sent any more; those that wait or drive still count.
    ``duels_live_only``: from now on its duels wait for a live event instead of being drawn at once.

    Raises UserFault("race_not_open_yet" | "race_closed" | "race_cancelled" | "race_recorded").
    """
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


def reset_invitation(*, race: Race) -> Race:
    """Give a race another invitation link; the old one joins nobody any more, who has joined stays."""
    race.invitation = new_invitation()
    race.save(update_fields=["invitation"])
    return race


@transaction.atomic
def renew_spectator_link(*, race: Race, now: datetime) -> Race:
    """Give a race another spectators' link. The old one opens nothing any more, and streams opened with it end."""
    Race.objects.filter(pk=race.pk).update(spectator_edition=F("spectator_edition") + 1)
    race.refresh_from_db(fields=["spectator_edition"])
    version = LiveEvent.objects.filter(race=race).values_list("version", flat=True).first()
    record(LIVE_CHANGED, at=now, **of_race(race), version=version or 0)
    return race


@transaction.atomic
def clone_race(*, race: Race, now: datetime, months: int = 1) -> Race:
    """The same race again, ``months`` calendar months later (the day is cut to the month's length), without entries.

    A cancelled or closed race can be cloned. Raises RaceRefused when the clone's time has passed already.
    """
    clone = Race(kind=race.kind, organiser=race.organiser, **{name: getattr(race, name) for name in _COPIED})
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
    """After the commit: whoever ends one of these evaluations waits for the race, which is locked here."""
    cars = Evaluation.objects.filter(submission__entry__race=race)
    transaction.on_commit(partial(reschedule, evaluations=cars, closes_at=closes_at), robust=True)


def _refuse_unknown(options: Iterable[str], *, but: Iterable[str] = (), also: Iterable[str] = ()) -> None:
    unknown = set(options) - set(EDITABLE_FIELDS).difference(but).union(also)
    if unknown:
        raise TypeError(f"not a field of a race that can be set: {', '.join(sorted(unknown))}")


_few_letters = partial(get_random_string, 5, "abcdefghjkmnpqrstuvwxyz23456789")
