"""Asks provider and directory whether they would let somebody in, for ``manage.py doctor``."""

from collections.abc import Iterator
from urllib.parse import urlsplit

from allauth.socialaccount.providers.oauth2.client import OAuth2Error
from django.conf import settings
from requests import RequestException

from paddock.errors import PlatformFault

from .backends import is_installed
from .provider import ProviderAnswers

LOCAL = ("localhost", "127.0.0.1", "::1")


def provider_problems() -> Iterator[str]:
    """What is wrong with PADDOCK_OIDC_ISSUER."""
    answers = ProviderAnswers(None, settings.OIDC["id"])
    try:
        if not answers.keys().get("keys"):
            yield "it publishes no keys, so no ID token can be verified"
    except (RequestException, OAuth2Error) as error:
        yield str(error)
    parts = urlsplit(settings.OIDC["issuer"])
    if parts.scheme == "http" and parts.hostname not in LOCAL:
        yield "its address begins with http://, so everybody on the way can read and change what it sends"


def directory_problems() -> Iterator[str]:
    """What is wrong with PADDOCK_LDAP_URI."""
    directory = settings.LDAP
    parts = urlsplit(directory["uri"])
    if parts.scheme == "ldap" and not directory["start_tls"] and parts.hostname not in LOCAL:
        yield "passwords are sent in the clear: set PADDOCK_LDAP_START_TLS=True"
    if not is_installed():
        yield str(PlatformFault("ldap_not_installed"))
        return
    from .directory import LDAPError, bind

    try:
        bind()
    except LDAPError as error:
        yield f"it cannot be asked: {error.args[0].get('desc', error) if error.args else error}"
