"""The page of a racer's API tokens."""

from typing import Any

from allauth.account.decorators import reauthentication_required
from django import forms
from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from core.addresses import origin_of
from core.pages.faults import faults_reported

from ..request_racer import racer_of
from ..scopes import LABELS, SCOPES
from .services import TOKENS_PER_RACER, create_token, revoke_token, tokens_of

DAYS = (1, 7, 30, 90, 366)


class TokenForm(forms.Form):
    scopes = forms.MultipleChoiceField(
        label=gettext_lazy("Scopes"), choices=[*LABELS.items()], initial=SCOPES, widget=forms.CheckboxSelectMultiple
    )
    days = forms.TypedChoiceField(label=gettext_lazy("Valid for"), coerce=int)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        days = sorted({*DAYS, settings.TOKEN_DAYS})
        field = self.fields["days"]
        assert isinstance(field, forms.ChoiceField)
        field.choices = [(day, ngettext("%(n)s day", "%(n)s days", day) % {"n": day}) for day in days]
        field.initial = settings.TOKEN_DAYS


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@reauthentication_required(enabled=lambda request: request.method == "POST", app="allauth.account")
def api_tokens(request: HttpRequest) -> HttpResponse:
    """The racer's API tokens; a POST makes one and shows it this once."""
    text, now = "", timezone.now()
    form = TokenForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_reported(request):
            text = create_token(racer=racer_of(request), now=now, **form.cleaned_data)[1]
        if not text:
            return redirect("api_tokens")
        form = TokenForm()
    context = {"tokens": tokens_of(racer_of(request), now), "token": text, "form": form, "limit": TOKENS_PER_RACER}
    context["origin"] = origin_of(request)
    return render(request, "accounts/tokens/tokens.html", context)


@login_required
@require_POST
def api_token_revoke(request: HttpRequest, key: str) -> HttpResponse:
    if not revoke_token(racer=racer_of(request), key=key):
        raise Http404
    messages.success(request, _("Token revoked. Programs that use it can no longer connect."))
    return redirect("api_tokens")
