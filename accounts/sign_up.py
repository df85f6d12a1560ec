"""Who may sign up: everybody, who holds an invitation of an admin, or nobody (PADDOCK_SIGN_UP)."""

from __future__ import annotations

from allauth.account.adapter import DefaultAccountAdapter
from django.conf import settings
from django.contrib.auth.base_user import AbstractBaseUser
from django.db import transaction
from django.forms import BaseForm
from django.http import HttpRequest
from django.utils import timezone

from .selectors import open_invitation
from .services import take_up_invitation

OPEN, INVITATION, CLOSED = "open", "invitation", "closed"
MODES = (OPEN, INVITATION, CLOSED)

# Where a visitor's session keeps the code of the invitation whose link was followed.
CODE = "sign_up_invitation"


class AccountAdapter(DefaultAccountAdapter):
    """allauth's, with our rule of who may sign up."""

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
