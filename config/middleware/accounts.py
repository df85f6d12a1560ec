"""Redirects of accounts: back to a form after log-in, classes to their class, admins to their second factor."""

from typing import Any
from urllib.parse import parse_qs, urlsplit

from django.conf import settings
from django.contrib import messages
from django.contrib.auth import REDIRECT_FIELD_NAME
from django.contrib.auth.views import redirect_to_login
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, resolve_url
from django.utils.deprecation import MiddlewareMixin
from django.utils.http import url_has_allowed_host_and_scheme
from django.utils.translation import gettext as _

from accounts.class_accounts.services import is_learner
from accounts.signing_in.second_factor import SHOWN_TO_PROVIDER, lacks_demanded_factor
from config.api.auth import SecondFactorMissing
from core.api.errors import handle

_READS = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})
_CLOSED = (
    *("/accounts/email/", "/accounts/password/", "/accounts/2fa/", "/accounts/3rdparty/"),
    *("/accounts/confirm-email/", "/settings/tokens/"),
)
# The pages of one's own account (allauth's names), and the buttons in the head of each of them
OWN_ACCOUNT = ("account_", "mfa_")
ANYWHERE = {"theme", "set_language", "favicon", "health_live", "health_ready", "metrics"}


class LoginRedirect(MiddlewareMixin):
    """Middleware: a log-in that a sent form led to ends on the form's page, or at home where the browser names none:
    the address of the form answers no GET."""

    def process_response(self, request: HttpRequest, response: HttpResponse) -> HttpResponse:
        if request.method not in _READS and response.status_code == 302 and _leads_to_log_in(response["Location"]):
            response["Location"] = redirect_to_login(_page_of_form(request))["Location"]
        return response


def _leads_to_log_in(location: str) -> bool:
    parts = urlsplit(location)
    return parts.path == resolve_url(settings.LOGIN_URL) and REDIRECT_FIELD_NAME in parse_qs(parts.query)


def _page_of_form(request: HttpRequest) -> str:
    page = request.META.get("HTTP_REFERER", "")
    if not url_has_allowed_host_and_scheme(page, {request.get_host()}, require_https=request.is_secure()):
        return resolve_url(settings.LOGIN_REDIRECT_URL)
    parts = urlsplit(page)
    return parts._replace(scheme="", netloc="", fragment="").geturl() or "/"


class ClassAccountPages(MiddlewareMixin):
    """Middleware: redirects accounts of a class from pages about e-mail addresses, passwords, second factors and tokens
    to the class. A class code is their only log-in, and their teacher can replace it."""

    def process_request(self, request: HttpRequest) -> HttpResponse | None:
        is_closed = request.path.startswith(_CLOSED) and is_learner(request.user)
        return redirect("class_log_in") if is_closed else None


class StaffSecondFactor(MiddlewareMixin):
    """Middleware: redirects admins without a second factor to its setup page (PADDOCK_STAFF_SECOND_FACTOR).
    :mod:`config.api.auth` checks tokens."""

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> HttpResponse | None:
        if not settings.STAFF_SECOND_FACTOR or settings.SESSION_COOKIE_NAME not in request.COOKIES:
            return None
        match = request.resolver_match
        name = (match and match.url_name) or ""
        if name in ANYWHERE or name.startswith(OWN_ACCOUNT) or not lacks_demanded_factor(request.user):
            return None
        if request.session.get(SHOWN_TO_PROVIDER):
            return None
        if request.path.startswith("/api/"):
            refusal = handle(SecondFactorMissing(), {})
            return JsonResponse(refusal.data, status=refusal.status_code)
        messages.warning(request, _("Admins of this site need a second factor. Set one up to continue."))
        return redirect("mfa_index")
