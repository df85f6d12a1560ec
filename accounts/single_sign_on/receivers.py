"""What a log-in by a provider leaves in the session."""

from allauth.socialaccount.models import SocialLogin
from django.conf import settings
from django.http import HttpRequest

from ..signing_in.second_factor import SHOWN_TO_PROVIDER
from .provider import SEVERAL_FACTORS


def mark_the_session(
    sender: object, *, request: HttpRequest, sociallogin: SocialLogin | None = None, **kwargs: object
) -> None:
    """End the session soon, so that the provider is asked again; keep whether it asked for a second factor."""
    if sociallogin is None:
        return
    request.session.set_expiry(settings.SSO_SESSION_HOURS * 3600)
    request.session[SHOWN_TO_PROVIDER] = bool(sociallogin.account.extra_data.get(SEVERAL_FACTORS))
