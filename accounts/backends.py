"""How a password is checked."""

from __future__ import annotations

from typing import Any

from allauth.account.auth_backends import AuthenticationBackend
from django.contrib.auth.base_user import AbstractBaseUser
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest

from .log_in import racer_with


class PasswordBackend(AuthenticationBackend):
    """allauth's, with the answer final: one guess is one password hashed, be it right, wrong or of nobody.

    Django's own backend stays in the settings behind this one, for the sessions that were begun with it.
    """

    def authenticate(self, request: HttpRequest | None, **credentials: Any) -> AbstractBaseUser:
        """The racer. Raises PermissionDenied for all else, upon which no other backend is asked."""
        user = super().authenticate(request, **credentials)
        if user is None:
            raise PermissionDenied
        return user

    def _authenticate(self, request: HttpRequest | None, **credentials: Any) -> AbstractBaseUser | None:
        return self._check_password(racer_with(credentials), credentials["password"])
