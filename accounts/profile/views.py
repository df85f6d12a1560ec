"""The page of a racer's settings."""

from typing import Any

from django import forms
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_http_methods

from core.forms import say_saved

from ..models import Racer
from ..request_racer import racer_of
from .fields import editable
from .services import change_profile


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
