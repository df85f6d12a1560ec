"""Pages of programs, for admins."""

from typing import Any

from allauth.account.decorators import reauthentication_required
from django import forms
from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from core.addresses import origin_of
from core.pages.faults import faults_shown, report_fault
from paddock.errors import UserFault

from ..models import ServiceAccount
from ..request_racer import racer_of
from ..scopes import READ
from ..tokens.services import tokens_of
from ..tokens.views import TokenForm
from . import services


class ProgramForm(forms.Form):
    name = forms.SlugField(
        label=gettext_lazy("Name"), max_length=48, help_text=gettext_lazy("Its alias is “program-” and this name.")
    )
    purpose = forms.CharField(label=gettext_lazy("Purpose"), max_length=200)
    owner = forms.CharField(
        label=gettext_lazy("Owner"), max_length=64, help_text=gettext_lazy("The alias of the responsible racer.")
    )


class ProgramTokenForm(TokenForm):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["scopes"].initial = [READ]


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def programs(request: HttpRequest) -> HttpResponse:
    """All programs; a POST makes one."""
    _require(request)
    form = ProgramForm(request.POST or None, initial={"owner": racer_of(request).alias})
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            made = services.make_program(by=racer_of(request), now=timezone.now(), **form.cleaned_data)
            messages.success(request, _("Program created. It needs a token."))
            return redirect("program", made.racer.alias)
    context = {"programs": services.programs(), "form": form}
    return render(request, "accounts/programs/programs.html", context, status=422 if form.errors else 200)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def program(request: HttpRequest, alias: str) -> HttpResponse:
    """A program and its tokens; a POST does what ``action`` names, and shows a new token this once."""
    _require(request)
    return _program(request, alias)


@reauthentication_required(enabled=lambda request: request.method == "POST", app="allauth.account")
def _program(request: HttpRequest, alias: str) -> HttpResponse:
    shown = get_object_or_404(services.programs(), racer__alias__iexact=alias)
    action, text = request.POST.get("action", ""), ""
    form = ProgramTokenForm(request.POST if action == "create" else None)
    if request.method == "POST":
        try:
            text = _act(request, shown, action, form)
        except UserFault as fault:
            report_fault(request, fault)
            return redirect("program", shown.racer.alias)
        if not text and not form.errors:
            return redirect("program", shown.racer.alias)
    context = {"program": shown, "form": form, "token": text, "origin": origin_of(request)}
    context["tokens"] = tokens_of(shown.racer, timezone.now())
    return render(request, "accounts/programs/program.html", context, status=422 if form.errors else 200)


def _act(request: HttpRequest, shown: ServiceAccount, action: str, form: TokenForm) -> str:
    """The text of a new token, if the act makes one."""
    by, now, key = racer_of(request), timezone.now(), request.POST.get("key", "")
    if action == "create" and form.is_valid():
        return services.make_program_token(program=shown, by=by, now=now, **form.cleaned_data)[1]
    if action == "replace":
        made = services.replace_program_token(program=shown, by=by, key=key, days=settings.TOKEN_DAYS, now=now)
        return made[1] if made else ""
    if action == "revoke":
        services.revoke_program_token(program=shown, by=by, key=key)
    if action in ("disable", "enable"):
        services.switch_program(program=shown, by=by, active=action == "enable")
    return ""


def _require(request: HttpRequest) -> None:
    if not services.can_manage_programs(racer_of(request)):
        raise PermissionDenied
