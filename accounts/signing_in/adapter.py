"""The django-allauth adapter: rules of sign-up, reserved aliases, e-mails and limits on log-in attempts."""

import logging
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

from allauth.account.adapter import DefaultAccountAdapter
from django.conf import settings
from django.contrib import messages
from django.contrib.auth.base_user import AbstractBaseUser
from django.core.mail import EmailMessage
from django.db import transaction
from django.forms import BaseForm
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from . import attempt_limits as log_in
from .reserved_aliases import is_reserved, is_taken
from .services import CODE, INVITATION, may_sign_up, take_up_invitation

logger = logging.getLogger(__name__)


class AccountAdapter(DefaultAccountAdapter):
    """allauth's adapter with this site's sign-up rules and attempt limits."""

    # A racer's name is an alias on every page: allauth calls it a username.
    error_messages = DefaultAccountAdapter.error_messages | {
        "username_taken": _("This alias is taken. Choose another one."),
        "username_blacklisted": _("This alias is reserved. Choose another one."),
        "username_password_mismatch": _("The alias or the password is not correct."),
        "email_password_mismatch": _("The e-mail address or the password is not correct."),
        "email_taken": _("An account with this e-mail address exists already."),
    }

    def is_open_for_signup(self, request: HttpRequest) -> bool:
        return not settings.PASSWORD_RACERS and may_sign_up(request)

    def save_user(
        self, request: HttpRequest, user: AbstractBaseUser, form: BaseForm, commit: bool = True
    ) -> AbstractBaseUser:
        """The racer, and one place less on the invitation: both or neither. Raises UserFault("sign_up_invitation")."""
        with transaction.atomic():
            user = super().save_user(request, user, form, commit)
            if settings.SIGN_UP == INVITATION:
                take_up_invitation(code=request.session.get(CODE, ""), now=timezone.now())
        request.session.pop(CODE, None)
        return user

    def clean_username(self, username: str, shallow: bool = False) -> str:
        """Raises ValidationError for an alias that seems to speak for the site, too."""
        alias = super().clean_username(username, shallow)
        if is_reserved(alias):
            raise self.validation_error("username_blacklisted")
        if is_taken(alias, timezone.now()):
            raise self.validation_error("username_taken")
        return alias

    def render_mail(
        self,
        template_prefix: str,
        email: str | list[str],
        context: dict[str, object],
        headers: dict[str, str] | None = None,
    ) -> EmailMessage:
        """Render a mail with the site's host from the settings, not from the request."""
        host = urlsplit(settings.SITE_URL).netloc
        where = SimpleNamespace(domain=host, name=host)
        return super().render_mail(template_prefix, email, context | {"current_site": where}, headers)

    def send_mail(self, template_prefix: str, email: str, context: dict[str, object]) -> None:
        """Mails go while a page waits: one that cannot be sent is reported on the next page, and the rest is done."""
        try:
            super().send_mail(template_prefix, email, context)
        except OSError as error:  # all that smtplib and sockets raise
            logger.warning("A mail of an account could not be sent: %s", error)
            self.request.mail_failed = True
            messages.error(self.request, _("The e-mail could not be sent. Try again later."))

    def add_message(self, request: HttpRequest, *args: Any, **kwargs: Any) -> None:
        """Does not say that a mail was sent that was not."""
        is_of_mail = "account/messages/email_confirmation_sent.txt" in (*args, *kwargs.values())
        if not (is_of_mail and getattr(request, "mail_failed", False)):
            super().add_message(request, *args, **kwargs)

    def pre_authenticate(self, request: HttpRequest, **credentials: Any) -> None:
        """Count the attempt; allauth takes it back for a correct password. Raises ValidationError beyond the limits."""
        self._login_failed_rl_usage = log_in.begin(request, credentials, timezone.now())
        if self._login_failed_rl_usage is None:
            raise self.validation_error("too_many_login_attempts")

    def authentication_failed(self, request: HttpRequest, **credentials: Any) -> None:
        """A person of the directory without an account here has typed no wrong password."""
        if hasattr(request, "unlinked_person"):
            self._rollback_login_failed_rl_usage()

    def reauthenticate(self, user: AbstractBaseUser, password: str) -> bool:
        """Whether this is the password of the logged-in racer. allauth's page limits the attempts."""
        return user.check_password(password)
