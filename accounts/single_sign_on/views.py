"""Pages of log-in by a provider: the way there and back, the first log-in, and the connections of an account."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from allauth.account.views import LoginView
from allauth.core import ratelimit
from allauth.socialaccount.adapter import get_adapter
from allauth.socialaccount.helpers import complete_social_login, render_authentication_error
from allauth.socialaccount.models import SocialApp
from allauth.socialaccount.providers.oauth2.client import OAuth2Error
from allauth.socialaccount.providers.oauth2.views import OAuth2CallbackView
from allauth.socialaccount.views import ConnectionsView, SignupView
from django.conf import settings
from django.forms import BaseForm
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_GET
from requests import RequestException

from paddock.errors import PaddockError

from ..signing_in.attempt_limits import may_ask_for_challenge
from ..signing_in.receivers import begin_passing_session
from ..signing_in.views import FaultsInForm
from .adapter import refusal
from .provider import ProviderAnswers

View = Callable[..., HttpResponse]


def refused_in_words(view: View) -> View:
    """A view that shows its faults, and those of the provider, as a page with the reason."""

    @wraps(view)
    def inner(request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponse:
        try:
            return view(request, *args, **kwargs)
        except PaddockError as fault:
            return refusal(request, fault)
        except (RequestException, OAuth2Error) as error:
            provider = get_adapter(request).get_provider(request, settings.OIDC["id"])
            return render_authentication_error(request, provider, exception=error)
        except SocialApp.DoesNotExist:
            raise Http404 from None

    return inner


@never_cache
@refused_in_words
def begin(request: HttpRequest, provider_id: str) -> HttpResponse:
    """Send the browser to the provider by a page of ours: the form of a page may lead to this site only."""
    found = get_adapter(request).get_provider(request, provider_id)
    if request.method != "POST":
        return redirect("account_login")
    if not may_ask_for_challenge(request):
        return ratelimit.respond_429(request)
    if request.session.is_empty():
        begin_passing_session(request)
    address = found.redirect_from_request(request).url
    return render(request, "accounts/single_sign_on/leaving.html", {"address": address, "provider": found})


@never_cache
@require_GET
@refused_in_words
def callback(request: HttpRequest, provider_id: str) -> HttpResponse:
    """Where the provider sends the browser back."""
    return OAuth2CallbackView.adapter_view(ProviderAnswers(request, provider_id))(request)


class FirstLogInView(FaultsInForm, SignupView):
    """Choose an alias."""

    template_name = "accounts/single_sign_on/first_log_in.html"


class OwnConnectionsView(ConnectionsView):
    """The racer's connections to providers, to add and to remove."""

    template_name = "accounts/single_sign_on/connections.html"


class DirectoryLogInView(LoginView):
    """allauth's page; people of the directory without an account here go on to choose an alias."""

    def form_invalid(self, form: BaseForm) -> HttpResponse:
        person = getattr(self.request, "unlinked_person", None)
        if person is None:
            return super().form_invalid(form)
        return refused_in_words(complete_social_login)(self.request, person)
