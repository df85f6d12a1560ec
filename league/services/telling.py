"""Writing notices: to whom, once each, and whether by mail as well."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

from allauth.account.models import EmailAddress
from django.db import transaction
from django.db.models import Exists, OuterRef, Q

from accounts.models import Racer
from core.streams import poke_after_commit
from core.streams.topics import RACER
from core.wakeup import wake
from races.models import Division, Entry, Race, RaceKind

from ..models import Mail, Membership, Notice, NoticeChoice, NoticeKind, Round
from ..models.notice import NOT_MAILED
from ..models.season import WITH_FIELD

SEEN_LATELY = timedelta(days=60)  # who has not logged in for longer is not reminded of open races
BATCH = 500


@dataclass(frozen=True)
class Told:
    """Something to tell racers (ids)."""

    kind: NoticeKind
    about: str
    racers: Iterable[int]
    path: str
    params: Mapping[str, Any] = field(default_factory=dict)


def tell(told: Told, now: datetime) -> int:
    """Write notices to all who can read them and want them; those who were told already are left out. Returns how many
    were written; mails go once the transaction is committed."""
    ids = list(told.racers)
    written, mails = 0, 0
    for start in range(0, len(ids), BATCH):
        readers = Racer.objects.filter(pk__in=ids[start : start + BATCH], is_active=True, is_house=False)
        known = Notice.objects.filter(kind=told.kind, about=told.about, racer=OuterRef("pk"))
        new = list(readers.exclude(Exists(known)).values_list("pk", flat=True))
        choices = NoticeChoice.objects.in_bulk(new)
        verified = verified_addresses(new)
        rows, by_mail = [], []
        for racer in new:
            chosen = choices.get(racer) or NoticeChoice(mail_off=list(NOT_MAILED))
            mailed = racer in verified and told.kind not in chosen.mail_off
            hidden = told.kind in chosen.site_off
            if mailed:
                by_mail.append(racer)
            # also who wants none has a row, so that nothing is told twice
            rows.append(
                Notice(
                    racer_id=racer,
                    kind=told.kind,
                    about=told.about,
                    path=told.path,
                    params=dict(told.params),
                    at=now,
                    hidden=hidden,
                )
            )
        with transaction.atomic():
            Notice.objects.bulk_create(rows, ignore_conflicts=True)
            mine = Notice.objects.filter(kind=told.kind, about=told.about, racer__in=by_mail).order_by("pk")
            poke_after_commit(f"{RACER}:{racer}" for racer in new)
            Mail.objects.bulk_create([Mail(notice=notice) for notice in mine], ignore_conflicts=True)
        written += len(rows)
        mails += len(by_mail)
    if mails:
        # a broker that is away is logged; the periodic task sends what is due within a minute all the same
        wake("league.tasks.notices")
    return written


def concerned(race: Race, now: datetime) -> list[int]:
    """Who is in a race, and for a league race who may be and looks in now and then."""
    racers = set(entered(race))
    round_ = Round.objects.filter(race=race).first()
    if round_ is None or race.kind != RaceKind.LEAGUE or round_.stage in WITH_FIELD:
        return sorted(racers)
    pros = Membership.objects.filter(season=round_.season_id, division=Division.PRO).values("racer")
    seen = Racer.objects.filter(Q(last_login__gt=now - SEEN_LATELY), is_active=True)
    if race.division == Division.PRO:
        seen = seen.filter(pk__in=pros)
    elif race.division == Division.OPEN:
        seen = seen.exclude(pk__in=pros)
    return sorted(racers | set(seen.values_list("pk", flat=True)))


def entered(race: Race) -> list[int]:
    """Who is in a race."""
    inside = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)
    return sorted(inside.values_list("racer", flat=True))


def admins_with(permission: str) -> list[int]:
    """Admins who have a permission, such as ``league.change_season``."""
    admins = Racer.objects.filter(is_staff=True, is_active=True).order_by("pk")
    return [admin.pk for admin in admins if admin.has_perm(permission)]


def verified_addresses(racers: Iterable[int]) -> dict[int, str]:
    """The confirmed address of each racer who has one: nobody else's mailbox is written to."""
    found = EmailAddress.objects.filter(user__in=list(racers), verified=True).order_by("primary", "pk")
    return dict(found.values_list("user_id", "email"))
