"""Notices: a word from organisers, what a racer wants to be told and how, and sending mails. What is told of what
happened stands in :mod:`league.services.news`."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.core import signing
from django.core.mail import get_connection
from django.core.mail.message import EmailMessage
from django.db import transaction
from django.db.models import F
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _

from accounts.models import Racer
from races.models import Race

from ..models import Notice, NoticeChoice, NoticeKind
from ..models.notice import NOT_MAILED
from ..notices import sentence
from .telling import Told, concerned, tell, verified_addresses

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
    """Mark one of the racer's notices as read, or all of them; returns how many were unread."""
    unread = Notice.objects.filter(racer=racer, read_at=None, hidden=False)
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
    Notice.objects.filter(racer=racer, kind=kind, mail_state="due").update(mail_state="")


def send_mails(*, now: datetime) -> int:
    """Send what is to go by mail: each at most once, three tries if the mail server refuses. Returns how many went."""
    due = Notice.objects.filter(mail_state="due").order_by("at", "pk").values_list("pk", flat=True)
    sent = 0
    with get_connection() as server:
        for pk in list(due[:MAILS_A_TIME]):
            # claimed before it is sent: a second sender finds nothing, and a crash loses a mail rather than doubles it
            if Notice.objects.filter(pk=pk, mail_state="due").update(mail_state="sent", mail_tries=F("mail_tries") + 1):
                sent += _mail(Notice.objects.select_related("racer").get(pk=pk), server)
    return sent


def forget_old_notices(*, now: datetime) -> int:
    """Delete notices of more than half a year ago. Returns how many."""
    return Notice.objects.filter(at__lt=now - KEPT).delete()[0]


def _mail(notice: Notice, server: Any) -> bool:
    address = verified_addresses([notice.racer_id]).get(notice.racer_id)
    if address is None:
        return False
    token = stopping_token(notice.racer_id, notice.kind)
    stop = f"{settings.SITE_URL}{reverse('notices_stop', args=[token])}"
    with translation.override(choice_of(notice.racer).language):
        text = sentence(notice)
        body = "\n\n".join(
            [
                _("Hello %(racer)s,") % {"racer": notice.racer.alias},
                text,
                f"{settings.SITE_URL}{notice.path}",
                _("Which notices you get is up to you: %(address)s")
                % {"address": f"{settings.SITE_URL}/settings/notices/"},
                _("No more e-mails of this kind: %(address)s") % {"address": stop},
            ]
        )
    try:
        # RFC 2369 and 8058: mail programs show a button that posts to this address
        headers = {"List-Unsubscribe": f"<{stop}>", "List-Unsubscribe-Post": "List-Unsubscribe=One-Click"}
        EmailMessage(f"[Paddock] {text}", body + "\n", to=[address], connection=server, headers=headers).send()
    except Exception as error:  # whatever the mail backend raises: it is tried again, then given up
        state = "due" if notice.mail_tries < MAIL_TRIES else "failed"
        Notice.objects.filter(pk=notice.pk).update(mail_state=state)
        trace = None if isinstance(error, OSError) else error  # a mail server that is away or refuses says enough
        logger.warning("A mail to a racer could not be sent (try %s): %s", notice.mail_tries, error, exc_info=trace)
        return False
    return True
