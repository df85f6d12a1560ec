"""A racer's webhooks: add one, try it, read what it was told, change its secret, take it away."""

from __future__ import annotations

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiResponse, extend_schema, extend_schema_field, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE
from accounts.tokens import scopes_of
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from league import chats
from league.happenings import EVENTS
from league.models import Webhook, WebhookDelivery
from league.selectors.webhooks import deliveries_of, races_to_hear_of, webhooks_of
from league.services.webhooks import add_webhook, change_secret, remove_webhook, send_test
from league.signing import shown

DELIVERY_STATES = ["due", "sent", "failed"]


class WebhookSerializer(serializers.Serializer):
    """An address that is told what happens."""

    id = serializers.IntegerField(source="pk")
    url = serializers.CharField()
    chat = serializers.SerializerMethodField(help_text="Discord or Slack, told in their own form; else null.")
    race = serializers.CharField(source="race.slug", default=None, allow_null=True, help_text="Null for all.")
    events = serializers.SerializerMethodField(help_text="What it is told.")
    secret = serializers.SerializerMethodField(
        help_text="What signs its deliveries (whsec_ and Base64); empty for a token that lacks the scope organise."
    )
    old_secret_until = serializers.DateTimeField(allow_null=True, help_text="Until then the secret before signs too.")
    created_at = serializers.DateTimeField()

    def get_chat(self, hook: Webhook) -> str | None:
        return chats.chat_of(hook.url)

    def get_events(self, hook: Webhook) -> list[str]:
        return hook.events or list(EVENTS)

    def get_secret(self, hook: Webhook) -> str:
        token = self.context["request"].auth
        return shown(hook.secret) if token is None or ORGANISE in scopes_of(token) else ""


class DeliverySerializer(serializers.Serializer):
    """One thing that a webhook was told."""

    id = serializers.SerializerMethodField(help_text="The header webhook-id.")
    event = serializers.CharField()
    state = serializers.SerializerMethodField()
    tries = serializers.IntegerField(source="attempt")
    status = serializers.IntegerField(allow_null=True, help_text="Of the last answer.")
    error = serializers.CharField(allow_blank=True, help_text="Why there was no answer.")
    body = serializers.CharField()
    at = serializers.DateTimeField()
    next_at = serializers.DateTimeField(help_text="When it is tried next, of one that is due.")

    def get_id(self, delivery: WebhookDelivery) -> str:
        return f"msg_{delivery.pk}"

    @extend_schema_field(serializers.ChoiceField(DELIVERY_STATES))
    def get_state(self, delivery: WebhookDelivery) -> str:
        return "due" if delivery.is_due else delivery.state


class WebhookBody(Body):
    """Where to, and what."""

    url = serializers.URLField(max_length=500, help_text="http or https; an address of Discord or Slack just works.")
    race = serializers.CharField(
        required=False, allow_null=True, max_length=80, help_text="The slug of a race of yours or that you are in."
    )
    events = serializers.ListField(
        child=serializers.ChoiceField(EVENTS), required=False, max_length=100, help_text="All if left out."
    )


@extend_schema_view(
    get=extend_schema(
        operation_id="list_webhooks", summary="My webhooks", responses=WebhookSerializer, tags=["webhooks"]
    )
)
class WebhooksView(generics.ListAPIView):
    """A racer's webhooks: list them, add one."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]
    serializer_class = WebhookSerializer

    def get_queryset(self) -> QuerySet[Webhook]:
        return webhooks_of(self.request.user)

    @extend_schema(
        operation_id="add_webhook",
        summary="Add a webhook",
        request=WebhookBody,
        responses={201: WebhookSerializer},
        tags=["webhooks"],
    )
    def post(self, request: Request) -> Response:
        sent = read_as(WebhookBody, request.data)
        slug = sent.get("race")
        race = None if slug is None else get_object_or_404(races_to_hear_of(racer_of(request)), slug=slug)
        hook = add_webhook(owner=racer_of(request), url=sent["url"], race=race, events=sent.get("events", ()))
        return Response(WebhookSerializer(hook, context={"request": request}).data, status=status.HTTP_201_CREATED)


class WebhookView(APIView):
    """One of my webhooks."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="read_webhook", summary="A webhook", responses=WebhookSerializer, tags=["webhooks"])
    def get(self, request: Request, number: int) -> Response:
        return Response(WebhookSerializer(_own(request, number), context={"request": request}).data)

    @extend_schema(
        operation_id="remove_webhook",
        summary="Take a webhook away",
        request=None,
        responses={204: OpenApiResponse(description="It is told nothing more.")},
        tags=["webhooks"],
    )
    def delete(self, request: Request, number: int) -> Response:
        refuse_fields(request)
        remove_webhook(webhook=_own(request, number))
        return Response(status=status.HTTP_204_NO_CONTENT)


class WebhookSecretView(APIView):
    """Another secret."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="change_webhook_secret",
        summary="Give a webhook a new secret",
        description="For a day the one before signs as well: both signatures stand in webhook-signature.",
        request=None,
        responses=WebhookSerializer,
        tags=["webhooks"],
    )
    def post(self, request: Request, number: int) -> Response:
        hook = _own(request, number)
        refuse_fields(request)
        hook = change_secret(webhook=hook, now=timezone.now())
        return Response(WebhookSerializer(hook, context={"request": request}).data)


class WebhookTestView(APIView):
    """Trying one."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="test_webhook",
        summary="Send a test delivery to a webhook",
        description="The event webhook.test, once. Its answer stands among the deliveries after a moment.",
        request=None,
        responses={202: DeliverySerializer},
        tags=["webhooks"],
    )
    def post(self, request: Request, number: int) -> Response:
        hook = _own(request, number)
        refuse_fields(request)
        queued = send_test(webhook=hook, now=timezone.now())
        return Response(DeliverySerializer(queued).data, status=status.HTTP_202_ACCEPTED)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_deliveries",
        summary="What a webhook was told, the latest first",
        responses=DeliverySerializer,
        tags=["webhooks"],
    )
)
class DeliveriesView(generics.ListAPIView):
    """The deliveries of a webhook."""

    permission_classes = [IsAuthenticated]
    serializer_class = DeliverySerializer

    def get_queryset(self) -> QuerySet[WebhookDelivery]:
        if getattr(self, "swagger_fake_view", False):  # the schema is being written
            return WebhookDelivery.objects.none()
        return deliveries_of(self.request.user).filter(webhook=_own(self.request, self.kwargs["number"]))


def _own(request: Request, number: int) -> Webhook:
    return get_object_or_404(webhooks_of(request.user), pk=number)
