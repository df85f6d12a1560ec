"""Admins without a second factor get nowhere but to the pages where one is made (PADDOCK_STAFF_SECOND_FACTOR)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from django.conf import settings
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect
from django.utils.translation import gettext as _

from accounts.second_factor import lacks_demanded_factor
from config.api.auth import SecondFactorMissing
from core.api.errors import handle

# The pages of one's own account (allauth's names), and the buttons in the head of each of them
OWN_ACCOUNT = ("account_", "mfa_")
ANYWHERE = {"theme", "set_language", "favicon", "health_live", "health_ready"}


class SecondFactorOfStaff:
    """Middleware. Tokens are looked at where they are taken (:mod:`config.api.auth`)."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        return self.get_response(request)

    def process_view(self, request: HttpRequest, view: Any, args: Any, kwargs: Any) -> HttpResponse | None:
        """Django calls it once it knows which view answers."""
        if not settings.STAFF_SECOND_FACTOR or settings.SESSION_COOKIE_NAME not in request.COOKIES:
            return None
        match = request.resolver_match
        name = (match and match.url_name) or ""
        if name in ANYWHERE or name.startswith(OWN_ACCOUNT) or not lacks_demanded_factor(request.user):
            return None
        if request.path.startswith("/api/"):
            refusal = handle(SecondFactorMissing(), {})
            return JsonResponse(refusal.data, status=refusal.status_code)
        messages.warning(request, _("Admins of this site need a second factor. Set one up to continue."))
        return redirect("mfa_index")
