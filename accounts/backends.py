"""How a password is checked."""

from typing import Any

from allauth.account.auth_backends import AuthenticationBackend
from django.contrib.auth.base_user import AbstractBaseUser
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest

from core.database.kept_queries import KeptQuery

from .models import Racer
from .signing_in.attempt_limits import racer_with
from .signing_in.services import may_use_password

_racers = KeptQuery(lambda pk: Racer.objects.select_related("learner__classroom").filter(pk=pk).order_by())


class PasswordBackend(AuthenticationBackend):
    """allauth's backend with a final answer: one guess hashes one password. Django's backend serves older sessions."""

    def authenticate(self, request: HttpRequest | None, **credentials: Any) -> AbstractBaseUser | None:
        """The racer. Raises PermissionDenied for all else, upon which no other backend is asked."""
        user = super().authenticate(request, **credentials)
        if user is None:
            raise PermissionDenied
        return user

    def get_user(self, user_id: Any) -> AbstractBaseUser | None:
        """The racer of a session, with their class, which pages of races ask for."""
        racer = next(iter(_racers(pk=user_id)), None)
        return racer if racer is not None and self.user_can_authenticate(racer) else None

    def user_can_authenticate(self, user: Any) -> bool:
        """As Django's; programs have tokens and no sessions."""
        return super().user_can_authenticate(user) and not user.is_program

    def _authenticate(self, request: HttpRequest | None, **credentials: Any) -> AbstractBaseUser | None:
        racer = racer_with(credentials)
        return self._check_password(racer if racer and may_use_password(racer) else None, credentials["password"])
