"""Pages of a racer's webhooks and their latest deliveries."""

from datetime import datetime
from typing import Any, cast
from urllib.parse import urlsplit

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.pages.faults import faults_reported, faults_shown
from league.models import Webhook, WebhookDelivery
from league.webhooks.deliveries import shown
from league.webhooks.payloads import EVENTS, LABELS, TEST, chat_of
from league.webhooks.selectors import deliveries_of, races_for_webhooks, webhooks_of
from league.webhooks.services import PER_RACER, add_webhook, change_secret, remove_webhook, secrets_of, send_test
from races.models import Race

SHOWN = 20
# what a delivery failed for, by its ``error``; the codes of faults beside those of league.webhooks.services
FAILED_FOR = {
    "webhook_address": gettext_lazy("invalid delivery address"),
    "webhook_name": gettext_lazy("name not on the internet"),
    "webhook_private": gettext_lazy("the address is in a private network"),
    "no_such_name": gettext_lazy("unknown host"),
    "refused": gettext_lazy("the connection was refused"),
    "too_slow": gettext_lazy("timeout"),
    "no_tls": gettext_lazy("the certificate is not valid"),
    "no_http": gettext_lazy("the answer was not HTTP"),
    "no_connection": gettext_lazy("no connection"),
    "host_away": gettext_lazy("host unreachable for 12 hours"),
}


class WebhookForm(forms.Form):
    url = forms.URLField(
        label=gettext_lazy("Address"),
        max_length=500,
        assume_scheme="https",
        help_text=gettext_lazy("The address of your program, or a Discord or Slack channel webhook."),
    )
    events = forms.MultipleChoiceField(
        label=gettext_lazy("Events"),
        choices=[(event, gettext_lazy(label)) for event, label in LABELS.items()],
        initial=EVENTS,
        widget=forms.CheckboxSelectMultiple,
    )
    race = forms.ModelChoiceField(
        label=gettext_lazy("Race"),
        queryset=Race.objects.none(),
        required=False,
        empty_label=gettext_lazy("all my races"),
    )

    def __init__(self, *args: Any, racer: Racer, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        cast("forms.ModelChoiceField", self.fields["race"]).queryset = races_for_webhooks(racer)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def webhooks(request: HttpRequest) -> HttpResponse:
    """The racer's webhooks with their secrets and last deliveries; a POST adds one."""
    form = WebhookForm(request.POST or None, racer=racer_of(request))
    if request.method == "POST" and form.is_valid():
        with faults_shown(form):
            add_webhook(owner=racer_of(request), **form.cleaned_data)
            messages.success(request, _("Webhook created."))
            return redirect("webhooks")
    deliveries = deliveries_of(request.user)[:SHOWN]
    now = timezone.now()
    context = {
        "form": form,
        "hooks": [_row(hook, now) for hook in webhooks_of(request.user)],
        "deliveries": [(one, urlsplit(one.webhook.url).hostname, _answer(one)) for one in deliveries],
        "test_waits": any(one.event == TEST and one.is_due for one in deliveries),
        "limit": PER_RACER,
    }
    return render(request, "league/webhooks/webhooks.html", context, status=422 if form.errors else 200)


def _row(hook: Webhook, now: datetime) -> dict[str, object]:
    return {
        "hook": hook,
        "chat": chat_of(hook.url),
        "secret": shown(hook.secret),
        "old_until": hook.old_secret_until if len(secrets_of(hook, now)) > 1 else None,
        "events": hook.events or list(EVENTS),
    }


def _answer(delivery: WebhookDelivery) -> str:
    """The last answer in the reader's language: a status, or why there is none."""
    if delivery.status is None:
        return str(FAILED_FOR.get(delivery.error, delivery.error))
    if 300 <= delivery.status < 400:
        return _("%(status)s · redirects are not followed") % {"status": delivery.status}
    return str(delivery.status)


@login_required
@require_POST
def webhook_test(request: HttpRequest, pk: int) -> HttpResponse:
    """Send a test delivery to one of the racer's webhooks: queued here, sent by the task that sends all of them."""
    hook = get_object_or_404(webhooks_of(request.user), pk=pk)
    with faults_reported(request):
        send_test(webhook=hook, now=timezone.now())
        messages.success(request, _("Test sent. The answer appears below."))
    return redirect("webhooks")


@login_required
@require_POST
def webhook_secret(request: HttpRequest, pk: int) -> HttpResponse:
    hook = get_object_or_404(webhooks_of(request.user), pk=pk)
    change_secret(webhook=hook, now=timezone.now())
    messages.success(request, _("New secret set. The previous one stays valid for a day."))
    return redirect("webhooks")


@login_required
@require_POST
def webhook_remove(request: HttpRequest, pk: int) -> HttpResponse:
    remove_webhook(webhook=get_object_or_404(webhooks_of(request.user), pk=pk))
    messages.success(request, _("Webhook deleted."))
    return redirect("webhooks")
