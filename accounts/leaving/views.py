"""The pages of a racer's own data and of the deletion of their account."""

from datetime import timedelta
from typing import Any

from allauth.account.adapter import get_adapter
from allauth.account.decorators import reauthentication_required
from django import forms
from django.contrib import messages
from django.contrib.auth import logout
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from core.forms import explain
from core.pages.faults import faults_reported, faults_shown
from paddock.errors import UserFault

from ..class_accounts.services import is_learner
from ..models import Racer
from ..request_racer import racer_of
from .downloads import download_of_data
from .services import check_own_deletion, delete_account

FRESH = timedelta(minutes=10)  # since the log-in of an account without a password


class DeletionForm(forms.Form):
    """The typed confirmation."""

    alias = forms.CharField(
        label=gettext_lazy("Type your alias to confirm"),
        max_length=64,
        widget=forms.TextInput(attrs={"autocomplete": "off", "spellcheck": "false"}),
    )

    def __init__(self, data: Any = None, *, racer: Racer) -> None:
        super().__init__(data)
        self.racer = racer

    def clean_alias(self) -> str:
        alias: str = self.cleaned_data["alias"]
        if alias != self.racer.alias:
            raise forms.ValidationError(explain(UserFault("account_not_confirmed")), code="account_not_confirmed")
        return alias


@login_required
@require_safe
def own_data(request: HttpRequest) -> HttpResponse:
    return render(request, "accounts/leaving/own_data.html", {"is_learner": is_learner(request.user)})


@login_required
@never_cache
@require_POST
@reauthentication_required(app="allauth.account")
def data_download(request: HttpRequest) -> HttpResponseBase:
    """The racer's data as a zip, soon after a log-in."""
    with faults_reported(request):
        return download_of_data(racer=racer_of(request), now=timezone.now())
    return redirect("own_data")


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@reauthentication_required(enabled=lambda request: request.method == "POST", app="allauth.account")
def account_delete(request: HttpRequest) -> HttpResponse:
    """What goes and what stays; a POST with the typed alias, soon after a log-in, deletes the account."""
    racer, now = racer_of(request), timezone.now()
    form = DeletionForm(request.POST or None, racer=racer)
    refusal = ""
    try:
        check_own_deletion(racer=racer, now=now)
    except UserFault as fault:
        refusal = explain(fault)
    if request.method == "POST" and form.is_valid() and not refusal:
        with faults_shown(form):
            require_fresh(racer=racer)
            delete_account(racer=racer, by=racer, now=now)
            logout(request)
            messages.success(request, _("Your account is deleted."))
            return redirect("home")
    return render(request, "accounts/leaving/delete.html", {"form": form, "refusal": refusal})


def require_fresh(*, racer: Racer) -> None:
    """Where an account has no password and no second factor to ask for, the log-in itself must be recent. Raises
    UserFault("account_log_in_again")."""
    is_fresh = racer.last_login is not None and timezone.now() - racer.last_login < FRESH
    if not is_fresh and not get_adapter().get_reauthentication_methods(racer):
        raise UserFault("account_log_in_again")
