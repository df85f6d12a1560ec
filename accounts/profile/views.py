"""The page of a racer's settings."""

from typing import Any

from django import forms
from django.conf import settings
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_http_methods

from core.forms import say_saved
from core.pages.faults import faults_shown

from ..models import Racer
from ..request_racer import racer_of
from .aliases import change_alias, next_change_at
from .fields import editable
from .services import change_profile


class NewAliasForm(forms.Form):
    alias = forms.CharField(
        label=gettext_lazy("New alias"),
        max_length=64,
        help_text=gettext_lazy("2 to 64 English letters, digits, hyphens and underscores."),
        widget=forms.TextInput(attrs={"autocomplete": "off", "spellcheck": "false"}),
    )


class ProfileForm(forms.Form):
    def __init__(self, data: Any = None, *, racer: Racer) -> None:
        super().__init__(data, initial={name: field.value(racer, racer) for name, field in editable().items()})
        self.fields |= {name: field.form() for name, field in editable().items() if field.form is not None}


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def settings_page(request: HttpRequest) -> HttpResponse:
    form = ProfileForm(request.POST or None, racer=racer_of(request))
    if request.method == "POST" and form.is_valid():
        change_profile(racer=racer_of(request), values=form.cleaned_data, now=timezone.now())
        say_saved(request, form)
        return redirect("settings")
    return render(request, "accounts/profile/settings.html", {"form": form})


@login_required
@require_http_methods(["GET", "HEAD", "POST"])
def alias_page(request: HttpRequest) -> HttpResponse:
    """The form for another alias, and the past ones."""
    racer, now = racer_of(request), timezone.now()
    form = NewAliasForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        with faults_shown(form, "alias"):
            change_alias(racer=racer, alias=form.cleaned_data["alias"], now=now)
            say_saved(request, form)
            return redirect("alias")
    context = {"form": form, "past": racer.past_aliases.all(), "next_at": next_change_at(racer, now)}
    days = {"change_days": settings.ALIAS_CHANGE_DAYS, "reserved_days": settings.ALIAS_RESERVED_DAYS}
    return render(request, "accounts/profile/alias.html", context | days)
