"""Log-in by the password of an LDAP directory, through the site's own form and its limits on attempts."""

import logging
from importlib.util import find_spec
from typing import Any

from django.contrib.auth.base_user import AbstractBaseUser
from django.http import HttpRequest

from paddock.errors import PlatformFault

from ..backends import PasswordBackend

logger = logging.getLogger(__name__)


def is_installed() -> bool:
    """Whether this Python has what asks a directory: “make ldap” installs it."""
    return all(find_spec(name) for name in ("ldap", "django_auth_ldap"))


class DirectoryBackend(PasswordBackend):
    """Asks the directory before the site's own passwords. What went wrong with it is ``request.directory_fault``."""

    def authenticate(self, request: HttpRequest | None, **credentials: Any) -> AbstractBaseUser | None:
        """The racer who is linked to the entry with this name and password. A person without an account here is
        ``request.unlinked_person``, for the form to go on with."""
        name, password = credentials.get("username") or credentials.get("email"), credentials.get("password")
        if request is None or not name or not password:
            return None
        if not is_installed():
            logger.error("PADDOCK_LDAP_URI is set, but its packages are not installed: make ldap")
            request.directory_fault = PlatformFault("ldap_not_installed")  # type: ignore[attr-defined]
            return None
        from .directory import Directory  # python-ldap, in processes in which somebody logs in

        racer = Directory().authenticate(request, username=name, password=password)
        if racer is not None and not self.user_can_authenticate(racer):
            self._stash_user(racer)  # the form shows that the account is deactivated
            return None
        return racer
