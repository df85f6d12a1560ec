"""Jobs that are e-mails: a kind of job that sends what is due through one connection."""

import logging
from abc import abstractmethod
from datetime import datetime, timedelta
from smtplib import SMTPRecipientsRefused, SMTPResponseException, SMTPSenderRefused
from typing import TypeVar

from django.core.mail import get_connection
from django.core.mail.message import EmailMessage
from django.db.models import F, QuerySet

from .kinds import JobKind
from .models import Leased

logger = logging.getLogger(__name__)
MAILS_A_TIME = 200
MAIL_TRIES, PUT_OFF_TRIES = 3, 8
LEASE, PAUSE, LONGEST_PAUSE = timedelta(minutes=5), timedelta(minutes=1), timedelta(hours=4)
J = TypeVar("J", bound=Leased)


class MailKind(JobKind[J]):
    """E-mails, one job each.

    A job fails when its sender was lost (it may have been sent), at a final refusal, after :data:`PUT_OFF_TRIES`
    temporary refusals and after :data:`MAIL_TRIES` other faults. An unreachable server costs no attempt."""

    queue = "messages"
    waiting, working, finished = "due", "sending", "sent"
    needs = ()

    @property
    def lease(self) -> timedelta:
        return LEASE

    def lost(self, mine: QuerySet[J], job: J, now: datetime) -> bool:
        return self.end(mine, state=self.failed, now=now)

    @abstractmethod
    def message(self, job: J, now: datetime) -> EmailMessage | None:
        """The mail; None if it must not be sent any more."""

    def send_due(self, *, now: datetime, worker: str) -> int:
        """Send what is due, through one connection while the server keeps it. Returns how many went."""
        self.sweep(now=now, wake=False)
        server, sent = get_connection(), 0
        try:
            for _number in range(MAILS_A_TIME):
                job = self.claim(worker=worker, now=now)
                if job is None:
                    break
                mine, message = self.held(job.pk, job.lease), self.message(job, now)
                if message is None:
                    self.end(mine, state=self.failed, now=now)
                    continue
                message.connection = server
                try:
                    server.open()
                except OSError as error:
                    logger.warning("The mail server cannot be reached: %s", error)
                    self.put_back(mine, now=now, pause=PAUSE, attempt=F("attempt") - 1)
                    break
                try:
                    message.send()
                except Exception as error:  # whatever the mail backend raises
                    server.close()  # it may be dead, and the next mail would fail with it
                    self._failed(mine, job, error, now)
                else:
                    sent += self.end(mine, state=self.finished, now=now)
        finally:
            server.close()
        return sent

    def _failed(self, mine: QuerySet[J], job: J, error: Exception, now: datetime) -> None:
        codes = _codes(error)
        is_put_off = any(400 <= code < 500 for code in codes)
        pause = min(PAUSE * 4 ** (job.attempt - 1), LONGEST_PAUSE) if is_put_off else PAUSE
        is_final = (codes and not is_put_off) or job.attempt >= (PUT_OFF_TRIES if is_put_off else MAIL_TRIES)
        if is_final:
            self.end(mine, state=self.failed, now=now)
        else:
            self.put_back(mine, now=now, pause=pause)
        trace = (
            None if isinstance(error, OSError) else error
        )  # the error of an unreachable or refusing server is enough
        logger.warning("%s %s could not be sent (try %s): %s", self.name, job.pk, job.attempt, error, exc_info=trace)


def _codes(error: Exception) -> list[int]:
    """What a mail server answered to a mail or to its recipients; empty where it did not answer."""
    if isinstance(error, SMTPRecipientsRefused):
        return [code for code, _answer in error.recipients.values()]
    if isinstance(error, SMTPResponseException) and not isinstance(error, SMTPSenderRefused):
        return [error.smtp_code] if error.smtp_code > 0 else []
    return []  # a sender is refused for the configuration, not for this mail
