"""API operations on a racer's webhooks and their deliveries."""

from typing import NotRequired, TypedDict

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers, status
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from accounts.tokens.services import may_read_secrets
from core.api.bodies import Body
from core.api.fields import ComputedField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from league.models import Webhook, WebhookDelivery
from league.webhooks.deliveries import shown
from league.webhooks.payloads import EVENTS, chat_of
from league.webhooks.selectors import deliveries_of, races_for_webhooks, webhooks_of
from league.webhooks.services import add_webhook, change_secret, refuse_undeliverable, remove_webhook, send_test

DELIVERY_STATES = ["due", "sent", "failed"]


class WebhookSerializer(serializers.Serializer):
    """A webhook."""

    id = serializers.IntegerField(source="pk")
    url = serializers.CharField()
    chat = ComputedField(
        serializers.CharField(allow_null=True),
        lambda hook: chat_of(hook.url),
        help_text="discord or slack, which get their own format; else null.",
    )
    race = serializers.CharField(source="race.slug", default=None, allow_null=True, help_text="Null for all.")
    events = ComputedField(
        serializers.ListField(child=serializers.CharField()),
        lambda hook: hook.events or list(EVENTS),
        help_text="The events that it receives.",
    )
    secret = serializers.SerializerMethodField(
        help_text="What signs its deliveries (whsec_ and Base64); empty for a token that lacks the scope organise."
    )
    old_secret_until = serializers.DateTimeField(allow_null=True, help_text="Until then the secret before signs too.")
    created_at = serializers.DateTimeField()

    def get_secret(self, hook: Webhook) -> str:
        return shown(hook.secret) if may_read_secrets(self.context["request"]) else ""


class DeliverySerializer(serializers.Serializer):
    """A delivery of a webhook."""

    id = ComputedField(serializers.CharField(), lambda one: f"msg_{one.pk}", help_text="The header webhook-id.")
    event = serializers.CharField()
    state = ComputedField(serializers.ChoiceField(DELIVERY_STATES), lambda one: "due" if one.is_due else one.state)
    tries = serializers.IntegerField(source="attempt")
    status = serializers.IntegerField(allow_null=True, help_text="Of the last answer.")
    error = serializers.CharField(allow_blank=True, help_text="Why there was no answer.")
    body = serializers.CharField()
    at = serializers.DateTimeField()
    next_at = serializers.DateTimeField(help_text="When it is tried next, of one that is due.")


class WebhookBody(Body):
    """Where to, and what."""

    url = serializers.URLField(max_length=500, help_text="http or https; an address of Discord or Slack just works.")
    race = serializers.CharField(
        required=False, allow_null=True, max_length=80, help_text="The slug of a race of yours or that you are in."
    )
    events = serializers.ListField(
        child=serializers.ChoiceField(EVENTS), required=False, max_length=100, help_text="All if left out."
    )


class SentWebhook(TypedDict):
    url: str
    race: NotRequired[str | None]
    events: NotRequired[list[str]]


def _own(request: Request, number: int) -> Webhook:
    return get_object_or_404(webhooks_of(request.user), pk=number)


class WebhooksView(PrivateView):
    token_scope = ORGANISE
    slow_methods = ("POST",)

    @operation("list_webhooks", "My webhooks", answer=WebhookSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Webhook]:
        return webhooks_of(request.user)

    @operation("add_webhook", "Add a webhook", body=WebhookBody, answer=WebhookSerializer, status=201)
    def post(self, request: Request, sent: SentWebhook) -> Response:
        slug = sent.get("race")
        race = None if slug is None else get_object_or_404(races_for_webhooks(racer_of(request)), slug=slug)
        refuse_undeliverable(sent["url"])

        def make() -> Response:
            hook = add_webhook(
                owner=racer_of(request),
                url=sent["url"],
                race=race,
                events=sent.get("events", ()),
                is_deliverable=True,
            )
            return Response(WebhookSerializer(hook, context={"request": request}).data, status=status.HTTP_201_CREATED)

        return self.write(make)


class WebhookView(PrivateView):
    token_scope = ORGANISE

    @operation("read_webhook", "A webhook", find=_own, answer=WebhookSerializer)
    def get(self, request: Request, hook: Webhook) -> Webhook:
        return hook

    @operation("remove_webhook", "Take a webhook away", find=_own, answer="It receives nothing more.")
    def delete(self, request: Request, hook: Webhook) -> None:
        remove_webhook(webhook=hook)


class WebhookSecretView(APIView):
    token_scope = ORGANISE

    @operation(
        "change_webhook_secret",
        "Give a webhook a new secret",
        find=_own,
        answer=WebhookSerializer,
        description="For a day the one before signs as well: both signatures stand in webhook-signature.",
    )
    def post(self, request: Request, hook: Webhook) -> Webhook:
        return change_secret(webhook=hook, now=timezone.now())


class WebhookTestView(APIView):
    token_scope = ORGANISE

    @operation(
        "test_webhook",
        "Send a test delivery to a webhook",
        find=_own,
        answer=DeliverySerializer,
        status=202,
        description="The event webhook.test, once. Its answer stands among the deliveries after a moment.",
    )
    def post(self, request: Request, hook: Webhook) -> WebhookDelivery:
        return send_test(webhook=hook, now=timezone.now())


class DeliveriesView(PrivateView):
    @operation(
        "list_deliveries", "Deliveries of a webhook, the latest first", find=_own, answer=DeliverySerializer, paged=True
    )
    def get(self, request: Request, hook: Webhook) -> QuerySet[WebhookDelivery]:
        return deliveries_of(request.user).filter(webhook=hook)
