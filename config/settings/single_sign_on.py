"""Settings of single sign-on and of sign-up by domain, from the environment. Nothing set: no single sign-on."""

import os
from collections.abc import Collection
from pathlib import Path
from typing import TypedDict
from urllib.parse import urlsplit

from django.core.exceptions import ImproperlyConfigured

from .env import check_url, env_bool, env_choice, env_list, env_str, env_url

GROUP_TYPES = ("groupOfNames", "groupOfUniqueNames", "posixGroup", "nested")


class ProviderSettings(TypedDict, total=False):
    id: str
    issuer: str
    client_id: str
    secret: str
    label: str
    scopes: list[str]
    groups_claim: str


class DirectorySettings(TypedDict, total=False):
    uri: str
    label: str
    bind_dn: str
    bind_password: str
    user_dn: str
    user_base: str
    user_filter: str
    start_tls: bool
    ca_file: str
    attributes: dict[str, str]
    group_base: str
    group_type: str


def env_secret(name: str, path: str) -> str:
    """A secret from variable ``name``, or from the file ``path``, which ``name_FILE`` has named; empty where neither
    is set. Raises ImproperlyConfigured where both are, or the file cannot be read."""
    secret = os.environ.get(name, "")
    if secret and path:
        raise ImproperlyConfigured(f"Set {name} or {name}_FILE, not both.")
    if not path:
        return secret
    try:
        return Path(path).read_text().strip()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ImproperlyConfigured(f"{name}_FILE must be a file that can be read: {path}: {why}.") from None


def openid_connect() -> ProviderSettings:
    """The provider; empty where none is set. Raises ImproperlyConfigured for what cannot work."""
    issuer = env_url("PADDOCK_OIDC_ISSUER", "", ("https", "http"), "https://login.example.org/realms/racing")
    client, secret = env_str("PADDOCK_OIDC_CLIENT_ID", ""), _client_secret()
    if not issuer:
        if client or secret:
            raise ImproperlyConfigured("Set PADDOCK_OIDC_ISSUER too: the address of the provider.")
        return {}
    if not client:
        raise ImproperlyConfigured("Set PADDOCK_OIDC_CLIENT_ID too: the provider shows it beside the client.")
    scopes = env_str("PADDOCK_OIDC_SCOPES", "openid profile email").replace(",", " ").split()
    if "openid" not in scopes:
        raise ImproperlyConfigured("PADDOCK_OIDC_SCOPES must contain openid.")
    return {
        "id": "sso",  # in the address where the provider sends browsers back
        "issuer": issuer.rstrip("/"),
        "client_id": client,
        "secret": secret,
        "label": env_str("PADDOCK_OIDC_LABEL", "") or urlsplit(issuer).hostname or issuer,
        "scopes": scopes,
        "groups_claim": env_str("PADDOCK_OIDC_GROUPS_CLAIM", "groups"),
    }


def _client_secret() -> str:
    return env_secret("PADDOCK_OIDC_CLIENT_SECRET", env_str("PADDOCK_OIDC_CLIENT_SECRET_FILE", ""))


def ldap() -> DirectorySettings:
    """The directory; empty where none is set. Raises ImproperlyConfigured for what cannot work."""
    uri = env_str("PADDOCK_LDAP_URI", "")
    if not uri:
        return {}
    check_url("PADDOCK_LDAP_URI", uri.replace("ldapi://", "ldapi+unix://"), _LDAP, "ldaps://ldap.example.org")
    template, base = env_str("PADDOCK_LDAP_USER_DN", ""), env_str("PADDOCK_LDAP_USER_BASE", "")
    filter_ = env_str("PADDOCK_LDAP_USER_FILTER", "(uid=%(user)s)")
    if bool(template) == bool(base):
        raise ImproperlyConfigured("Set PADDOCK_LDAP_USER_BASE (search) or PADDOCK_LDAP_USER_DN (template).")
    for name, value in (("PADDOCK_LDAP_USER_DN", template), ("PADDOCK_LDAP_USER_FILTER", filter_)):
        if value and "%(user)s" not in value:
            raise ImproperlyConfigured(f"{name} must contain %(user)s, the name that the racer types.")
    ca_file = env_str("PADDOCK_LDAP_CA_FILE", "")
    if ca_file and not Path(ca_file).is_file():
        raise ImproperlyConfigured(f"PADDOCK_LDAP_CA_FILE must be a file with certificates, which {ca_file} is not.")
    return {
        "uri": uri,
        "label": env_str("PADDOCK_LDAP_LABEL", "") or urlsplit(uri).hostname or "LDAP",
        "bind_dn": env_str("PADDOCK_LDAP_BIND_DN", ""),
        "bind_password": env_secret("PADDOCK_LDAP_BIND_PASSWORD", env_str("PADDOCK_LDAP_BIND_PASSWORD_FILE", "")),
        "user_dn": template,
        "user_base": base,
        "user_filter": filter_,
        "start_tls": env_bool("PADDOCK_LDAP_START_TLS", uri.startswith("ldap://")),
        "ca_file": ca_file,
        "attributes": _attributes(),
        "group_base": env_str("PADDOCK_LDAP_GROUP_BASE", ""),
        "group_type": env_choice("PADDOCK_LDAP_GROUP_TYPE", "groupOfNames", GROUP_TYPES),
    }


_LDAP = ("ldap", "ldaps", "ldapi+unix")


def _attributes() -> dict[str, str]:
    """Which attribute of an entry is the racer's id, e-mail address and proposed alias."""
    found = {"id": "entryUUID", "email": "mail", "alias": "uid"}
    for pair in env_list("PADDOCK_LDAP_ATTRIBUTES"):
        ours, _, theirs = (part.strip() for part in pair.partition("="))
        if ours not in found or not theirs:
            raise ImproperlyConfigured(
                f"PADDOCK_LDAP_ATTRIBUTES must be like id=objectGUID,email=mail,alias=sAMAccountName, not {pair!r}."
            )
        found[ours] = theirs
    return found


def roles() -> tuple[tuple[str, str], ...]:
    """Pairs of a group of the provider and a role here. Raises ImproperlyConfigured for an unknown role."""
    text = env_str("PADDOCK_SSO_GROUPS", "")
    if not text:
        return ()
    from accounts.single_sign_on.role_mapping import roles_in  # not loaded where nothing is set

    try:
        return roles_in(text)
    except ValueError as problem:
        raise ImproperlyConfigured(f"PADDOCK_SSO_GROUPS must be like paddock-admins=admin: {problem}.") from None


def env_domains(name: str) -> tuple[str, ...]:
    """Domains of e-mail addresses; one that begins with a dot stands for those below it. Raises
    ImproperlyConfigured."""
    found = tuple(domain.lower() for domain in env_list(name))
    for domain in found:
        if "@" in domain or "." not in domain.strip(".") or not domain.isprintable():
            raise ImproperlyConfigured(f"{name} must be domains such as example.edu or .example.edu, not {domain!r}.")
    return found


def password_racers(provider: object) -> Collection[str]:
    """The aliases, in lower case, that alone log in by password; empty: everybody. Raises ImproperlyConfigured."""
    found = frozenset(alias.lower() for alias in env_list("PADDOCK_PASSWORD_RACERS"))
    if found and not provider:
        raise ImproperlyConfigured("PADDOCK_PASSWORD_RACERS needs PADDOCK_OIDC_ISSUER or PADDOCK_LDAP_URI.")
    return found
