"""Notices: a word from organisers, what a racer wants to be told and how, and sending mails. What is told of what
happened stands in :mod:`league.services.news`."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from datetime import datetime, timedelta

from django.conf import settings
from django.core import signing
from django.db import transaction
from django.utils import translation

from accounts.models import Racer
from races.models import Race

from ..models import Mail, Notice, NoticeChoice, NoticeKind
from ..models.notice import NOT_MAILED
from ..selectors.notices import notices_of
from .telling import Told, concerned, tell

logger = logging.getLogger(__name__)
KEPT = timedelta(days=180)
MAILS_A_TIME = 200
MAIL_TRIES = 3
_STOPPING = "league.notices.stop"


def announce(*, race: Race, text: str, now: datetime) -> int:
    """Tell everybody whom a race concerns a few words of its organisers; returns how many. Empty words tell nobody."""
    text = " ".join(text.split())[:500]
    if not text:
        return 0
    params = {"race": race.name, "text": text}
    about = f"{race.slug}:{now:%Y%m%d%H%M%S%f}"
    return tell(Told(NoticeKind.MESSAGE, about, concerned(race, now), race.get_absolute_url(), params), now)


def mark_read(*, racer: Racer, now: datetime, notice: int | None = None) -> int:
    """Mark one of the racer's notices as read, or all that are shown to them; returns how many were unread."""
    unread = notices_of(racer).filter(read_at=None).order_by()
    if notice is not None:
        unread = unread.filter(pk=notice)
    return unread.update(read_at=now)


@transaction.atomic
def choose_notices(*, racer: Racer, site_off: Iterable[str], mail_off: Iterable[str], language: str) -> NoticeChoice:
    """Say which kinds the racer does not want in the site or by mail, and the language of mails. Raises ValueError."""
    site, mail = (sorted(set(kinds)) for kinds in (site_off, mail_off))
    if not set(site + mail) <= set(NoticeKind.values) or language not in dict(settings.LANGUAGES):
        raise ValueError("no such kind of notice, or no such language")
    values = {"site_off": site, "mail_off": mail, "language": language}
    return NoticeChoice.objects.update_or_create(racer=racer, defaults=values)[0]


def choice_of(racer: Racer) -> NoticeChoice:
    """What the racer has chosen, or what is usual; not saved then."""
    chosen = NoticeChoice.objects.filter(racer=racer).first()
    return chosen or NoticeChoice(racer=racer, mail_off=list(NOT_MAILED), language=translation.get_language() or "en")


def stopping_token(racer_id: int, kind: str) -> str:
    """What a mail carries so that its reader can turn mails of its kind off without logging in."""
    return signing.dumps([racer_id, kind], salt=_STOPPING)


def what_stops(token: str) -> tuple[Racer, NoticeKind] | None:
    """Whose mails of which kind a token turns off; None for a token that this site did not write."""
    try:
        racer_id, kind = signing.loads(token, salt=_STOPPING)
    except (signing.BadSignature, ValueError, TypeError):
        return None
    racer = Racer.objects.filter(pk=racer_id, is_active=True).first()
    return None if racer is None or kind not in NoticeKind.values else (racer, NoticeKind(kind))


@transaction.atomic
def stop_mails(*, racer: Racer, kind: NoticeKind) -> None:
    """Turn mails of one kind off; everything else stays as the racer has it. Doing it again changes nothing."""
    chosen = choice_of(racer)
    chosen.mail_off = sorted({*chosen.mail_off, kind.value})
    chosen.save()
    Mail.objects.filter(notice__racer=racer, notice__kind=kind, state="due").delete()


def forget_old_notices(*, now: datetime) -> int:
    """Delete notices of more than half a year ago. Returns how many."""
    return Notice.objects.filter(at__lt=now - KEPT).delete()[0]
