"""django-allauth's adapter for providers: admission, the right account, and pages of refusal."""

import logging
import re

from allauth.account.models import EmailAddress
from allauth.core.exceptions import ImmediateHttpResponse
from allauth.socialaccount.adapter import DefaultSocialAccountAdapter
from allauth.socialaccount.models import SocialAccount, SocialApp, SocialLogin
from allauth.socialaccount.providers.base import AuthError, AuthProcess, Provider
from allauth.socialaccount.providers.openid_connect.provider import OpenIDConnectProvider
from django.conf import settings
from django.db import transaction
from django.db.models import Q
from django.forms import BaseForm
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils.translation import gettext_lazy as _
from requests import RequestException

from core.jobs.models import reason_sentence
from paddock.errors import PaddockError, PlatformFault, UserFault

from ..models import Racer
from ..signing_in.services import SINGLE_SIGN_ON, is_of_domain, may_sign_up, require_welcome_domain
from .roles import apply_roles

logger = logging.getLogger(__name__)


def refusal(request: HttpRequest, fault: PaddockError) -> HttpResponse:
    """The page with the reason why a log-in by a provider has failed."""
    context = {"code": fault.code, "reason": reason_sentence(fault.code, fault.params)}
    return render(request, "accounts/single_sign_on/refused.html", context, status=fault.reason.status)


class SingleSignOnAdapter(DefaultSocialAccountAdapter):
    """allauth's adapter with the provider of the environment, and this site's rules of admission."""

    error_messages = DefaultSocialAccountAdapter.error_messages | {
        "no_password": _("Set a password first: without it you could not log in any more."),
    }

    def list_apps(
        self, request: HttpRequest, provider: str | None = None, client_id: str | None = None
    ) -> list[SocialApp]:
        """The provider of the environment; rows of allauth's own table are not read."""
        if not settings.OIDC or provider not in (None, OpenIDConnectProvider.id, settings.OIDC["id"]):
            return []
        app = SocialApp(
            provider=OpenIDConnectProvider.id,
            provider_id=settings.OIDC["id"],
            name=settings.OIDC["label"],
            client_id=settings.OIDC["client_id"],
            secret=settings.OIDC["secret"],
            settings={
                "server_url": settings.OIDC["issuer"],
                "scope": settings.OIDC["scopes"],
                "oauth_pkce_enabled": True,
            },
        )
        return [app] if client_id in (None, app.client_id) else []

    def is_open_for_signup(self, request: HttpRequest, sociallogin: SocialLogin) -> bool:
        return settings.SIGN_UP == SINGLE_SIGN_ON or may_sign_up(request)

    def is_email_verified(self, provider: Provider, email: str) -> bool:
        """Whether the operator vouches for the provider's addresses of this domain (PADDOCK_SSO_VERIFIED_DOMAINS)."""
        return is_of_domain(email, settings.SSO_VERIFIED_DOMAINS)

    def authenticate_by_email(self, sociallogin: SocialLogin) -> tuple[Racer, str] | None:
        """The account that this person owns too: provider and site have both verified the same address.

        Not one of another person of this provider, to whom the address belonged before, and none of a class.
        """
        for address in sociallogin.email_addresses:
            if address.verified:
                found = EmailAddress.objects.filter(email=address.email.lower(), verified=True, user__learner=None)
                others = SocialAccount.objects.filter(provider=sociallogin.account.provider).values("user")
                own = found.exclude(user__in=others).select_related("user").first()
                if own is not None:
                    return own.user, own.email
        return None

    def pre_social_login(self, request: HttpRequest, sociallogin: SocialLogin) -> None:
        """Set the roles of a known racer; refuse an unknown one whose address others have or may not sign up.

        Raises UserFault("sso_address_taken" | "sign_up_domain").
        """
        if sociallogin.is_existing:
            if sociallogin.state.get("process") != AuthProcess.CONNECT:
                set_roles(sociallogin)
            return
        if sociallogin.state.get("process") == AuthProcess.CONNECT:
            return
        for address in sociallogin.email_addresses:
            require_welcome_domain(address.email)
            taken = Q(email=address.email) | Q(emailaddress__email=address.email, emailaddress__verified=True)
            if address.verified and Racer.objects.filter(taken).exists():
                raise UserFault("sso_address_taken", email=address.email, provider=str(sociallogin.provider))

    def populate_user(self, request: HttpRequest, sociallogin: SocialLogin, data: dict[str, str]) -> Racer:
        """Propose an alias: the person's name at the provider, in the letters of an alias."""
        racer = sociallogin.user
        racer.alias = re.sub(r"[^A-Za-z0-9_-]+", "-", data.get("username", "").partition("@")[0])[:64].strip("-")
        racer.email = next((address.email for address in sociallogin.email_addresses), "")
        return racer

    def get_signup_form_initial_data(self, sociallogin: SocialLogin) -> dict[str, str]:
        return {"username": sociallogin.user.alias, "email": sociallogin.user.email}

    def save_user(self, request: HttpRequest, sociallogin: SocialLogin, form: BaseForm | None = None) -> Racer:
        """The racer, their link to the provider and their roles: all or nothing."""
        with transaction.atomic():
            racer = super().save_user(request, sociallogin, form)
            set_roles(sociallogin)
        return racer

    def on_authentication_error(
        self,
        request: HttpRequest,
        provider: Provider,
        error: str | None = None,
        exception: Exception | None = None,
        extra_context: dict[str, object] | None = None,
    ) -> None:
        """Show why, as a page of ours."""
        named = {"provider": str(provider)}
        fault: PaddockError
        if error == AuthError.CANCELLED:
            fault = UserFault("sso_cancelled", **named)
        elif isinstance(exception, RequestException):
            fault = PlatformFault("sso_unreachable", **named)
        elif exception is None and "state_id" in (extra_context or {}):
            fault = UserFault("sso_expired", **named)
        else:
            fault = UserFault("sso_failed", **named)
        logger.warning("Log-in by %s failed: %s %s", provider, fault.code, _described(request, exception))
        raise ImmediateHttpResponse(refusal(request, fault))


def set_roles(sociallogin: SocialLogin) -> None:
    """Apply the groups that the provider has named; without any knowledge of groups nothing changes."""
    groups = sociallogin.account.extra_data.get("groups")
    if groups is not None:
        apply_roles(racer=sociallogin.user, groups=groups)


def _described(request: HttpRequest, exception: Exception | None) -> str:
    """For the log: what went wrong, in one short line."""
    words = f"{request.GET.get('error', '')} {request.GET.get('error_description', '')}"
    return " ".join((str(exception) if exception else words).split())[:300]
