"""Whether e-mails leave this site."""

from __future__ import annotations

from django.conf import settings

_CONSOLE = "django.core.mail.backends.console.EmailBackend"


def mail_is_sent() -> bool:
    """Whether a mail server is configured (``EMAIL_URL``); without one, e-mails are only written to the log."""
    return settings.EMAIL_BACKEND != _CONSOLE
