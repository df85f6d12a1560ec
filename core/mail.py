"""Whether this site sends e-mails, and the folder that keeps them if not."""

import logging
from collections.abc import Sequence
from pathlib import Path

from django.conf import settings
from django.core.mail import EmailMessage
from django.core.mail.backends.filebased import EmailBackend

logger = logging.getLogger(__name__)
FOLDER_BACKEND = "core.mail.FolderBackend"
KEPT = 1000  # files; the oldest make way


class FolderBackend(EmailBackend):
    """Writes e-mails to files of the data folder, for a site without a mail server; the log names the file alone."""

    def send_messages(self, email_messages: Sequence[EmailMessage]) -> int:
        sent = super().send_messages(email_messages) or 0
        if sent:
            logger.warning("There is no mail server (EMAIL_URL): an e-mail was written to %s", self._get_filename())  # type: ignore[attr-defined]
            for old in sorted(Path(settings.EMAIL_FILE_PATH).glob("*.log"))[:-KEPT]:
                old.unlink(missing_ok=True)
        return sent


def mail_is_sent() -> bool:
    """Whether a mail server is configured (``EMAIL_URL``); without one, e-mails are only written to files."""
    return settings.EMAIL_BACKEND != FOLDER_BACKEND
