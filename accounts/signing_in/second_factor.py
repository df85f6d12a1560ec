"""The second factor beside a password: an app's codes, codes on paper, passkeys. allauth.mfa does the work."""

from urllib.parse import urlsplit

from allauth.mfa.adapter import DefaultMFAAdapter
from allauth.mfa.models import Authenticator
from django.conf import settings
from django.db.models import QuerySet

from ..models import Racer, Viewer

# The session key that records a second factor at the provider
SHOWN_TO_PROVIDER = "second_factor_shown_to_provider"
FACTORS = (Authenticator.Type.TOTP, Authenticator.Type.WEBAUTHN)


class SecondFactorAdapter(DefaultMFAAdapter):
    """allauth's adapter with the site's name and host from the settings, not from the request."""

    def _get_site_name(self) -> str:
        return f"Paddock {_host()}"

    def _get_user_identifier(self, user: Racer) -> str:
        return user.alias

    def get_public_key_credential_rp_entity(self) -> dict[str, str]:
        """A passkey belongs to the host where the site is reached."""
        return {"id": _host(), "name": self._get_site_name()}


def factors_of(racer: Racer) -> QuerySet[Authenticator]:
    """What the racer may show beside the password. Codes on paper alone do not count."""
    return Authenticator.objects.filter(user=racer, type__in=FACTORS)


def lacks_demanded_factor(racer: Viewer) -> bool:
    """Whether this is an admin on a site that demands a second factor of admins, and there is none."""
    if not isinstance(racer, Racer) or not racer.is_staff or racer.is_program:
        return False
    return bool(settings.STAFF_SECOND_FACTOR and not factors_of(racer).exists())


def forget_second_factor(*, racer: Racer) -> int:
    """Remove all second factors of a racer; returns how many there were, lists of recovery codes included."""
    return Authenticator.objects.filter(user=racer).delete()[0]


def _host() -> str:
    return urlsplit(settings.SITE_URL).hostname or ""
