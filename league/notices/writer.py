"""Write notices to racers, once each, and queue their e-mails."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.db import transaction
from django.db.models import Exists, OuterRef, Q

from accounts.models import Racer
from core.streams import poke_after_commit
from core.streams.topics import RACER
from core.wakeups.workers import wake
from races.models import Division, Entry, Race, RaceKind

from ..models import Mail, Membership, Notice, NoticeChoice, Round
from ..models.season import WITH_FIELD
from .kinds import NoticeKind, not_mailed

SEEN_LATELY = timedelta(days=60)  # racers without a log-in for longer get no reminders of open races
BATCH = 500


# What a notice's sentence names, by the names in it; ``reason_params`` are details of a fault.
Params = Mapping[str, str | int | Mapping[str, object] | None]


@dataclass(frozen=True)
class NewNotice:
    """A notice for some racers (ids)."""

    kind: NoticeKind
    about: str
    racers: Iterable[int]
    path: str
    params: Params = field(default_factory=dict)


def notify(notice: NewNotice, now: datetime) -> int:
    """Write a notice to each of its active racers without it, hidden where its kind is off; returns how many were
    written."""
    ids = list(notice.racers)
    written, mails = 0, 0
    for start in range(0, len(ids), BATCH):
        readers = Racer.objects.filter(pk__in=ids[start : start + BATCH], is_active=True, is_house=False)
        known = Notice.objects.filter(kind=notice.kind, about=notice.about, racer=OuterRef("pk"))
        new = list(readers.exclude(Exists(known)).values_list("pk", flat=True))
        choices = NoticeChoice.objects.in_bulk(new)
        verified = verified_addresses(new)
        rows, by_mail = [], []
        for racer in new:
            chosen = choices.get(racer) or NoticeChoice(mail_off=not_mailed())
            mailed = racer in verified and notice.kind not in chosen.mail_off
            hidden = notice.kind in chosen.site_off
            if mailed:
                by_mail.append(racer)
            # a hidden notice has a row too, so that it is never written twice
            rows.append(
                Notice(
                    racer_id=racer,
                    kind=notice.kind,
                    about=notice.about,
                    path=notice.path,
                    params=dict(notice.params),
                    at=now,
                    hidden=hidden,
                )
            )
        with transaction.atomic():
            Notice.objects.bulk_create(rows, ignore_conflicts=True)
            mine = Notice.objects.filter(kind=notice.kind, about=notice.about, racer__in=by_mail).order_by("pk")
            poke_after_commit(f"{RACER}:{racer}" for racer in new)
            Mail.objects.bulk_create([Mail(notice=one) for one in mine], ignore_conflicts=True)
        written += len(rows)
        mails += len(by_mail)
    if mails:
        # a broker that is away is logged; the periodic task sends what is due within a minute all the same
        wake("league.tasks.notices")
    return written


def concerned_racers(race: Race, now: datetime) -> list[int]:
    """The racers in a race, and for a league race also the active racers who can enter it."""
    racers = set(entered_racers(race))
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


def entered_racers(race: Race) -> list[int]:
    inside = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)
    return sorted(inside.values_list("racer", flat=True))


def admins_with(permission: str) -> list[int]:
    """Admins with a permission, such as ``league.change_season``."""
    admins = Racer.objects.filter(is_staff=True, is_active=True).order_by("pk")
    return [admin.pk for admin in admins if admin.has_perm(permission)]


def verified_addresses(racers: Iterable[int]) -> dict[int, str]:
    found = EmailAddress.objects.filter(user__in=list(racers), verified=True).order_by("primary", "pk")
    return dict(found.values_list("user_id", "email"))
