"""Token authentication: ``Authorization: Bearer <token>`` or ``Token <token>``. Only a hash of a token is stored."""

from __future__ import annotations

from hmac import compare_digest
from typing import TYPE_CHECKING, Any

from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from drf_spectacular.contrib.knox_auth_token import KnoxTokenScheme
from knox.auth import TokenAuthentication as KnoxAuthentication
from knox.crypto import hash_token
from knox.models import get_token_model
from knox.settings import CONSTANTS
from rest_framework import status
from rest_framework.authentication import get_authorization_header
from rest_framework.exceptions import APIException, AuthenticationFailed

from accounts.scopes import in_order, needed
from accounts.signing_in.second_factor import lacks_demanded_factor
from accounts.tokens.services import grant_of, note_use

if TYPE_CHECKING:  # views import this module
    from drf_spectacular.openapi import AutoSchema
    from rest_framework.request import Request

SCHEMES = (b"bearer", b"token")  # RFC 6750's, and Knox's own
_invalid = gettext_lazy("Invalid token.")


class SecondFactorMissing(APIException):
    """An admin on a site that demands a second factor of admins."""

    status_code = status.HTTP_403_FORBIDDEN
    default_code = "second_factor_missing"
    default_detail = gettext_lazy("Admins of this site need a second factor. Set one up in your settings.")


class ScopeMissing(APIException):
    """A token without a scope that the operation requires."""

    status_code = status.HTTP_403_FORBIDDEN
    default_code = "scope_missing"
    default_detail = gettext_lazy("This token lacks a required scope.")

    def __init__(self, missing: list[str]) -> None:
        names = ", ".join(missing)
        super().__init__(_("This token lacks the scope %(scopes)s.") % {"scopes": names})
        self.params = {"scopes": names}


class TokenAuthentication(KnoxAuthentication):
    """Knox's authentication that also accepts RFC 6750's word and refuses bytes that are not text."""

    def authenticate(self, request: Request) -> tuple | None:
        """The racer and their token; None without a token. Raises ScopeMissing, SecondFactorMissing."""
        found = self._shown(request)
        if found is not None:
            racer, token = found
            if lacks_demanded_factor(racer):
                raise SecondFactorMissing()
            grant = grant_of(token)
            missing = in_order(
                set(needed(request.parser_context.get("view"), request.method or "")) - set(grant.scopes)
            )
            if missing:
                raise ScopeMissing(missing)
            note_use(grant=grant, now=timezone.now())
        return found

    def authenticate_header(self, request: Request) -> str:
        return "Bearer"

    def _shown(self, request: Request) -> tuple | None:
        word, __, rest = get_authorization_header(request).strip().partition(b" ")
        if word.lower() not in SCHEMES:
            return None
        token = rest.split()
        if len(token) != 1:
            raise AuthenticationFailed(_invalid)
        return self.authenticate_credentials(token[0])

    def authenticate_credentials(self, token: bytes) -> tuple:
        """The racer and the token with this text, in one query. Raises AuthenticationFailed."""
        if not token.isascii():
            raise AuthenticationFailed(_invalid)
        text = token.decode()
        alike = get_token_model().objects.filter(token_key=text[: CONSTANTS.TOKEN_KEY_LENGTH])
        for found in alike.select_related("user", "grant"):
            is_over = found.expiry is not None and found.expiry <= timezone.now()
            if not is_over and compare_digest(hash_token(text), found.digest):
                return self.validate_user(found)
        raise AuthenticationFailed(_invalid)


class TokenScheme(KnoxTokenScheme):
    target_class = TokenAuthentication  # type: ignore[assignment]  # a name or a class, as its own words say
    name = ["token", "bearer"]  # type: ignore[assignment]

    def get_security_definition(self, auto_schema: AutoSchema) -> list[dict[str, object]]:
        return [super().get_security_definition(auto_schema), {"type": "http", "scheme": "bearer"}]

    def get_security_requirement(self, auto_schema: AutoSchema) -> list[dict[str, list[Any]]]:
        return [{name: []} for name in self.name]
