"""Asks an LDAP directory with django-auth-ldap: password, attributes and groups of one person."""

from typing import Any

import ldap
from allauth.account.utils import get_next_redirect_url
from allauth.socialaccount.models import SocialAccount
from allauth.socialaccount.providers.base import AuthProcess
from django.conf import settings
from django.http import HttpRequest
from django_auth_ldap.backend import LDAPBackend, _LDAPUser, ldap_error
from django_auth_ldap.config import (
    GroupOfNamesType,
    GroupOfUniqueNamesType,
    LDAPSearch,
    NestedGroupOfNamesType,
    PosixGroupType,
)
from ldap import LDAPError as LDAPError
from ldap.cidict import cidict

from paddock.errors import PlatformFault

from ..models import Racer
from .provider import SEVERAL_FACTORS, DirectoryProvider, PersonDocument, digest_of
from .roles import apply_roles

PATIENCE_S = 5
ATTRIBUTES = ["*", "+"]  # entryUUID is an operational attribute, which a search returns by this word
GROUP_TYPES = {
    "groupOfNames": GroupOfNamesType,
    "groupOfUniqueNames": GroupOfUniqueNamesType,
    "posixGroup": PosixGroupType,
    "nested": NestedGroupOfNamesType,
}
GROUP_FILTER = (
    "(|(objectClass=groupOfNames)(objectClass=groupOfUniqueNames)(objectClass=posixGroup)(objectClass=group))"
)


class Directory(LDAPBackend):
    """django-auth-ldap's backend, which finds racers by a lasting id of their entry and never by a name."""

    def __init__(self) -> None:
        self.default_settings = _django_settings()

    def get_or_build_user(self, username: str, ldap_user: Any) -> tuple[Racer, bool]:
        """The linked racer, with their roles set. Raises AuthenticationFailed where there is none yet."""
        data = _data_of(ldap_user)
        linked = SocialAccount.objects.filter(provider=DirectoryProvider.id, uid=data["uid"]).select_related("user")
        account = linked.first()
        if account is None:
            request = ldap_user._request
            person = DirectoryProvider(request).sociallogin_from_response(request, data)
            person.state = {"process": AuthProcess.LOGIN, "next": get_next_redirect_url(request)}
            request.unlinked_person = person
            raise ldap_user.AuthenticationFailed("the entry is linked to no racer")
        if data["groups"] is not None:
            apply_roles(racer=account.user, groups=data["groups"])
        return account.user, False


def bind() -> None:
    """Connect and bind as the account that searches. Raises LDAPError."""
    _ = _LDAPUser(Directory(), username="nobody").connection


def _data_of(ldap_user: Any) -> PersonDocument:
    """A person's data from their entry. Raises AuthenticationFailed where it lacks an id."""
    names, found = settings.LDAP["attributes"], cidict(ldap_user.attrs or {})
    first = {ours: next(iter(found.get(theirs) or []), "") for ours, theirs in names.items()}
    if not first["id"]:
        raise ldap_user.AuthenticationFailed(f"the entry has no {names['id']}")
    id_ = first["id"].hex() if isinstance(first["id"], bytes) else first["id"]
    return {
        "uid": digest_of(names["id"].lower(), id_),
        "name": str(first["alias"]),
        "email": str(first["email"]),
        "email_verified": False,
        "groups": sorted(ldap_user.group_names) if settings.LDAP["group_base"] else None,
        SEVERAL_FACTORS: False,
    }


def _django_settings() -> dict[str, object]:
    """django-auth-ldap's settings. It never makes or changes a racer by itself."""
    directory = settings.LDAP
    options: dict[int, object] = {
        ldap.OPT_REFERRALS: 0,
        ldap.OPT_NETWORK_TIMEOUT: PATIENCE_S,
        ldap.OPT_TIMEOUT: PATIENCE_S,
    }
    if directory["uri"].startswith("ldaps://") or directory["start_tls"]:
        options[ldap.OPT_X_TLS_REQUIRE_CERT] = ldap.OPT_X_TLS_DEMAND
        if directory["ca_file"]:
            options[ldap.OPT_X_TLS_CACERTFILE] = directory["ca_file"]
        options[ldap.OPT_X_TLS_NEWCTX] = 0  # takes the options above, so it comes last
    found: dict[str, object] = {
        "SERVER_URI": directory["uri"],
        "START_TLS": directory["start_tls"],
        "CONNECTION_OPTIONS": options,
        "BIND_DN": directory["bind_dn"],
        "BIND_PASSWORD": directory["bind_password"],
        "BIND_AS_AUTHENTICATING_USER": not directory["bind_dn"],  # else nobody reads the entry
        "ALWAYS_UPDATE_USER": False,
        "USER_ATTRLIST": ATTRIBUTES,
    }
    if directory["user_dn"]:
        found["USER_DN_TEMPLATE"] = directory["user_dn"]
    else:
        search = LDAPSearch(directory["user_base"], ldap.SCOPE_SUBTREE, directory["user_filter"], ATTRIBUTES)
        found["USER_SEARCH"] = search
    if directory["group_base"]:
        found["GROUP_SEARCH"] = LDAPSearch(directory["group_base"], ldap.SCOPE_SUBTREE, GROUP_FILTER)
        found["GROUP_TYPE"] = GROUP_TYPES[directory["group_type"]]()
    return found


def note_failure(sender: object, *, request: HttpRequest | None, exception: Exception, **kwargs: object) -> None:
    """A receiver of errors of the directory itself: a wrong password is none."""
    if request is not None:
        request.directory_fault = PlatformFault("ldap_unreachable")  # type: ignore[attr-defined]


ldap_error.connect(note_failure, dispatch_uid="accounts.directory_failure")
