"""Pages of sign-up, invitations to sign up, and log-in by passkey."""

from typing import Any

from allauth.account.views import SignupView
from allauth.core import ratelimit
from allauth.mfa.webauthn.views import LoginWebAuthnView
from django.conf import settings
from django.forms import BaseForm
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe
from django.views.generic import FormView

from core.pages.faults import faults_shown

from .attempt_limits import may_ask_for_challenge
from .receivers import begin_passing_session
from .services import CODE, INVITATION, open_invitation


class FaultsInForm(FormView):
    """A form that shows a UserFault as its error: an invitation, for example, without a place left."""

    def form_valid(self, form: BaseForm) -> HttpResponse:
        with faults_shown(form):
            return super().form_valid(form)
        return self.form_invalid(form)


class SignUpView(FaultsInForm, SignupView):
    """allauth's page."""


class PasskeyLogInView(LoginWebAuthnView):
    """allauth's page with a limit on challenges, each of which gives a guest a short session."""

    def get(self, request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponse:
        if not may_ask_for_challenge(request):
            return ratelimit.respond_429(request)
        answer = super().get(request, *args, **kwargs)
        if not request.session.is_empty():
            begin_passing_session(request)
        return answer


@never_cache
@require_safe
def invitation(request: HttpRequest, code: str) -> HttpResponse:
    """The link of an invitation to sign up: it is stored in the session, and the visitor goes on to the form."""
    if request.user.is_authenticated:
        return redirect("home")
    if settings.SIGN_UP == INVITATION:
        if open_invitation(code, timezone.now()) is None:
            return render(request, "accounts/signing_in/invitation_over.html", status=404)
        request.session[CODE] = code
    return redirect("account_signup")
