"""Writes of notices: announcements, read marks, racers' settings, and deletion of old ones."""

from collections.abc import Iterable
from datetime import datetime, timedelta

from django.conf import settings
from django.core import signing
from django.core.mail.message import EmailMessage
from django.db import transaction
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from core.audit.recording import audited
from core.jobs.kinds import register
from core.jobs.mails import MailKind
from races.models import Race

from ..models import Mail, Notice, NoticeChoice
from .kinds import KINDS, MESSAGE, NoticeKind, not_mailed
from .selectors import notices_of, text_without_results
from .sentences import sentence
from .writer import NewNotice, concerned_racers, notify, verified_addresses

_STOPPING = "league.notices.stop"


@audited("race.announced", gettext_lazy("Message sent to the racers of a race"), target="race")
def announce(*, race: Race, text: str, now: datetime) -> int:
    """Send a notice from the organisers to all racers that a race concerns, unless empty; returns how many."""
    text = " ".join(text.split())[:500]
    if not text:
        return 0
    params = {"race": race.name, "text": text}
    about = f"{race.slug}:{now:%Y%m%d%H%M%S%f}"
    return notify(NewNotice(MESSAGE, about, concerned_racers(race, now), race.get_absolute_url(), params), now)


def mark_read(*, racer: Racer, now: datetime, notice: int | None = None) -> int:
    """Mark one of the racer's notices as read, or all that are shown to them; returns how many were unread."""
    unread = notices_of(racer).filter(read_at=None).order_by()
    if notice is not None:
        unread = unread.filter(pk=notice)
    return unread.update(read_at=now)


@transaction.atomic
def choose_notices(*, racer: Racer, site_off: Iterable[str], mail_off: Iterable[str], language: str) -> NoticeChoice:
    """Set the kinds that are off on the site and by e-mail, and the language of e-mails. Raises ValueError."""
    site, mail = sorted(set(site_off)), sorted(set(mail_off))
    if not set(site + mail) <= set(KINDS) or language not in dict(settings.LANGUAGES):
        raise ValueError("no such kind of notice, or no such language")
    values = {"site_off": site, "mail_off": mail, "language": language}
    return NoticeChoice.objects.update_or_create(racer=racer, defaults=values)[0]


def choice_of(racer: Racer) -> NoticeChoice:
    """A racer's notice settings, or unsaved default ones."""
    chosen = NoticeChoice.objects.filter(racer=racer).first()
    return chosen or NoticeChoice(racer=racer, mail_off=not_mailed(), language=translation.get_language() or "en")


def stopping_token(racer_id: int, kind: str) -> str:
    """The token of a link that turns off one kind of e-mail without a log-in."""
    return signing.dumps([racer_id, kind], salt=_STOPPING)


def what_stops(token: str) -> tuple[Racer, NoticeKind] | None:
    """The racer and the kind of notice of such a token; None for a token that this site did not sign."""
    try:
        racer_id, kind = signing.loads(token, salt=_STOPPING)
    except (signing.BadSignature, ValueError, TypeError):
        return None
    racer = Racer.objects.filter(pk=racer_id, is_active=True).first()
    return None if racer is None or kind not in KINDS else (racer, KINDS[kind])


@transaction.atomic
def stop_mails(*, racer: Racer, kind: NoticeKind) -> None:
    """Turn off e-mails of one kind; a repeated call changes nothing."""
    chosen = choice_of(racer)
    chosen.mail_off = sorted({*chosen.mail_off, kind})
    chosen.save()
    Mail.objects.filter(notice__racer=racer, notice__kind=kind, state="due").delete()


def forget_old_notices(*, now: datetime) -> int:
    """Delete notices older than ``NOTICES_KEPT_DAYS``, with 0 none. Returns how many."""
    days = settings.NOTICES_KEPT_DAYS
    return Notice.objects.filter(at__lt=now - timedelta(days=days)).delete()[0] if days else 0


class Mails(MailKind[Mail]):
    name, model, task = "Mail", Mail, "league.tasks.notices"
    since = "notice__at"
    related = ("notice__racer",)

    def message(self, job: Mail, now: datetime) -> EmailMessage | None:
        address = verified_addresses([job.notice.racer_id]).get(job.notice.racer_id)
        return None if address is None else _message(job.notice, address)  # None: confirmed no more


MAILS = register(Mails())


def send_mails(*, now: datetime, worker: str = "local") -> int:
    """Send the notices that are to go by mail. Returns how many went."""
    return MAILS.send_due(now=now, worker=worker)


def _message(notice: Notice, address: str) -> EmailMessage:
    token = stopping_token(notice.racer_id, notice.kind)
    stop = f"{settings.SITE_URL}{reverse('notices_stop', args=[token])}"
    with translation.override(choice_of(notice.racer).language):
        text = text_without_results(notice) or sentence(notice)
        body = "\n\n".join(
            [
                _("Hello %(racer)s,") % {"racer": notice.racer.alias},
                text,
                f"{settings.SITE_URL}{notice.path}",
                _("Choose your notices: %(address)s") % {"address": f"{settings.SITE_URL}/settings/notices/"},
                _("Unsubscribe from these e-mails: %(address)s") % {"address": stop},
            ]
        )
    # RFC 2369 and 8058: mail programs show a button that posts to this address
    headers = {"List-Unsubscribe": f"<{stop}>", "List-Unsubscribe-Post": "List-Unsubscribe=One-Click"}
    return EmailMessage(f"[Paddock] {text}", body + "\n", to=[address], headers=headers)
