"""Accounts of classes do nothing that needs an e-mail address or a password."""

from __future__ import annotations

from collections.abc import Callable

from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect

from accounts.classes import is_learner

_CLOSED = ("/accounts/email/", "/accounts/password/", "/accounts/2fa/", "/accounts/confirm-email/", "/settings/tokens/")


class NoMailForLearners:
    """Middleware: who is in a class comes from pages of addresses, passwords and second factors to their class: their
    teacher makes them another code, and nothing else ever lets them in."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if request.path.startswith(_CLOSED) and is_learner(request.user):
            return redirect("class_log_in")
        return self.get_response(request)
