"""A racer's own settings and API tokens."""

from __future__ import annotations

from typing import Any

from allauth.account.decorators import reauthentication_required
from allauth.account.views import SignupView
from allauth.core import ratelimit
from allauth.mfa.webauthn.views import LoginWebAuthnView
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.forms import BaseForm
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from accounts.forms import ProfileForm, TokenForm
from accounts.log_in import may_ask_for_challenge
from accounts.profile import change_profile
from accounts.receivers import begin_passing_session
from accounts.tokens import TOKENS_PER_RACER, create_token, revoke_token, tokens_of
from accounts.who import racer_of
from core.addresses import origin_of
from core.forms import add_fault, explain, say_saved
from paddock.errors import UserFault


class SignUpView(SignupView):
    """allauth's page; an invitation whose last place went in this very moment is an error of the form."""

    def form_valid(self, form: BaseForm) -> HttpResponse:
        try:
            return super().form_valid(form)
        except UserFault as fault:
            add_fault(form, fault)
            return self.form_invalid(form)


class PasskeyLogInView(LoginWebAuthnView):
    """allauth's. Every guest who asks for a challenge is given a session, so how often is limited, and how long it
    stays unless they log in."""

    def get(self, request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponse:
        if not may_ask_for_challenge(request):
            return ratelimit.respond_429(request)
        answer = super().get(request, *args, **kwargs)
        if not request.session.is_empty():
            begin_passing_session(request)
        return answer


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def settings_page(request: HttpRequest) -> HttpResponse:
    """Country, and the way to e-mail, password and tokens."""
    form = ProfileForm(request.POST or None, instance=request.user)
    if request.method == "POST" and form.is_valid():
        change_profile(racer=racer_of(request), now=timezone.now(), **form.cleaned_data)
        say_saved(request, form)
        return redirect("settings")
    return render(request, "accounts/settings.html", {"form": form})


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@reauthentication_required(enabled=lambda request: request.method == "POST", app="allauth.account")
def api_tokens(request: HttpRequest) -> HttpResponse:
    """The racer's API tokens; a POST makes one and shows it this once."""
    text, now = "", timezone.now()
    form = TokenForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        try:
            text = create_token(racer=racer_of(request), now=now, **form.cleaned_data)[1]
        except UserFault as fault:
            messages.error(request, explain(fault))
            return redirect("api_tokens")
        form = TokenForm()
    context = {"tokens": tokens_of(racer_of(request), now), "token": text, "form": form, "limit": TOKENS_PER_RACER}
    context["origin"] = origin_of(request)
    return render(request, "accounts/tokens.html", context)


@login_required
@require_POST
def api_token_revoke(request: HttpRequest, key: str) -> HttpResponse:
    """Revoke one of the racer's tokens."""
    if not revoke_token(racer=racer_of(request), key=key):
        raise Http404
    messages.success(request, _("Token revoked. Programs that use it can no longer connect."))
    return redirect("api_tokens")
