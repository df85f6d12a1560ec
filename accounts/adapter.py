"""What allauth asks of the site: who may sign up under which alias, and who may try to log in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

from allauth.account.adapter import DefaultAccountAdapter
from django.conf import settings
from django.contrib.auth.base_user import AbstractBaseUser
from django.core.mail import EmailMessage
from django.db import transaction
from django.forms import BaseForm
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from . import log_in
from .aliases import is_reserved
from .selectors import open_invitation
from .services import take_up_invitation
from .sign_up import CODE, INVITATION, OPEN


class AccountAdapter(DefaultAccountAdapter):
    """allauth's, with our rules of who may sign up, and our limits on guesses."""

    # A racer's name is an alias on every page: allauth calls it a username.
    error_messages = DefaultAccountAdapter.error_messages | {
        "username_taken": _("This alias is taken. Choose another one."),
        "username_blacklisted": _("This alias is reserved. Choose another one."),
        "username_password_mismatch": _("The alias or the password is not correct."),
        "email_password_mismatch": _("The e-mail address or the password is not correct."),
        "email_taken": _("An account with this e-mail address exists already."),
    }

    def is_open_for_signup(self, request: HttpRequest) -> bool:
        """Whether this visitor may sign up now."""
        if settings.SIGN_UP == INVITATION:
            return open_invitation(request.session.get(CODE, ""), timezone.now()) is not None
        return settings.SIGN_UP == OPEN

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
        return alias

    def render_mail(
        self,
        template_prefix: str,
        email: str | list[str],
        context: dict[str, Any],
        headers: dict[str, str] | None = None,
    ) -> EmailMessage:
        """A mail says where the site is by the settings, not by what a request was sent to."""
        host = urlsplit(settings.SITE_URL).netloc
        where = SimpleNamespace(domain=host, name=host)
        return super().render_mail(template_prefix, email, context | {"current_site": where}, headers)

    def pre_authenticate(self, request: HttpRequest, **credentials: Any) -> None:
        """Count the attempt; allauth takes it back once the password was right. Raises ValidationError beyond the
        limits of :mod:`accounts.log_in`."""
        self._login_failed_rl_usage = log_in.begin(request, credentials, timezone.now())
        if self._login_failed_rl_usage is None:
            raise self.validation_error("too_many_login_attempts")

    def reauthenticate(self, user: AbstractBaseUser, password: str) -> bool:
        """Whether it is the password of who is logged in already. allauth's page limits how often that is asked."""
        return user.check_password(password)
