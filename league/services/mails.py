"""Sending the notices that go by mail."""

from __future__ import annotations

import logging
from datetime import datetime, timedelta
from typing import Any

from django.conf import settings
from django.core.mail import get_connection
from django.core.mail.message import EmailMessage
from django.db.models import QuerySet
from django.urls import reverse
from django.utils import translation
from django.utils.translation import gettext as _

from core.jobs.kinds import JobKind, register

from ..models import Mail, Notice
from ..notices import sentence
from ..spoilers import told_instead
from .notices import choice_of, stopping_token
from .telling import verified_addresses

logger = logging.getLogger(__name__)
MAILS_A_TIME = 200
MAIL_TRIES = 3
LEASE, PAUSE = timedelta(minutes=5), timedelta(minutes=1)


class Mails(JobKind[Mail]):
    """First come, first sent. One whose sender was lost is given up: it may have gone, and is not sent twice."""

    name, model, task, queue = "Mail", Mail, "league.tasks.notices", "messages"
    waiting, working, finished = "due", "sending", "sent"
    related = ("notice__racer",)
    needs = ()

    @property
    def lease(self) -> timedelta:
        return LEASE

    def lost(self, mine: QuerySet[Mail], job: Mail, now: datetime) -> bool:
        return self.end(mine, state=self.failed, now=now)


MAILS = register(Mails())


def send_mails(*, now: datetime, worker: str = "local") -> int:
    """Send what is to go by mail: each at most once, three tries if the mail server refuses. Returns how many went."""
    MAILS.sweep(now=now, wake=False)
    sent = 0
    with get_connection() as server:
        for _number in range(MAILS_A_TIME):
            mail = MAILS.claim(worker=worker, now=now)
            if mail is None:
                break
            sent += _send(mail, server, now)
    return sent


def _send(mail: Mail, server: Any, now: datetime) -> bool:
    mine, notice = MAILS.held(mail.pk, mail.lease), mail.notice
    address = verified_addresses([notice.racer_id]).get(notice.racer_id)
    if address is None:  # confirmed no more
        MAILS.end(mine, state="failed", now=now)
        return False
    try:
        _message(notice, address, server).send()
    except Exception as error:  # whatever the mail backend raises: it is tried again, then given up
        if mail.attempt < MAIL_TRIES:
            MAILS.put_back(mine, now=now, pause=PAUSE)
        else:
            MAILS.end(mine, state="failed", now=now)
        trace = None if isinstance(error, OSError) else error  # a mail server that is away or refuses says enough
        logger.warning("A mail to a racer could not be sent (try %s): %s", mail.attempt, error, exc_info=trace)
        return False
    return MAILS.end(mine, state="sent", now=now)


def _message(notice: Notice, address: str, server: Any) -> EmailMessage:
    token = stopping_token(notice.racer_id, notice.kind)
    stop = f"{settings.SITE_URL}{reverse('notices_stop', args=[token])}"
    with translation.override(choice_of(notice.racer).language):
        text = told_instead(notice) or sentence(notice)
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
    return EmailMessage(f"[Paddock] {text}", body + "\n", to=[address], connection=server, headers=headers)
