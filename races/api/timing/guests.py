"""Guests: who raced without an account, and whose their laps become."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.models import Racer
from accounts.scopes import ORGANISE, RACE
from accounts.who import racer_of
from core.bodies import Body, read_as
from paddock.errors import UserFault

from ...models import Guest
from ...selectors.timing import guests_of
from ...services import timing
from ..entries import EntrySerializer
from ..lookup import organised_race
from .common import uuid_or_404


class GuestSerializer(serializers.Serializer):
    """A guest of the race."""

    id = serializers.UUIDField()
    name = serializers.CharField()
    racer = serializers.SerializerMethodField(help_text="Who has taken the laps over; null for nobody yet.")

    def get_racer(self, guest: Guest) -> str | None:
        return guest.entry.racer.alias if guest.linked_at else None


class OrganisersGuestSerializer(GuestSerializer):
    """A guest with the secret that their laps are taken over with."""

    claim = serializers.SerializerMethodField(help_text="To hand to the guest; null once the laps are taken over.")
    claim_url = serializers.SerializerMethodField(help_text="The page for it.")

    def get_claim(self, guest: Guest) -> str | None:
        return None if guest.linked_at else guest.claim

    def get_claim_url(self, guest: Guest) -> str | None:
        if guest.linked_at:
            return None
        request: Request = self.context["request"]
        return request.build_absolute_uri(reverse("guest_claim", args=[guest.claim]))


class LinkGuestSerializer(Body):
    """Whose the laps are."""

    racer = serializers.CharField(max_length=64, help_text="Alias.")


class ClaimSerializer(Body):
    """What the organiser has handed to the guest."""

    claim = serializers.CharField(max_length=64, help_text="The secret, which is also the end of the link's address.")


class GuestsView(APIView):
    """The guests of a race."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_guests",
        summary="Guests of a race that you organise, with the secrets that they take their laps over with",
        responses=OrganisersGuestSerializer(many=True),
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        guests = guests_of(organised_race(request, slug))
        return Response(OrganisersGuestSerializer(guests, many=True, context={"request": request}).data)


class GuestView(APIView):
    """One guest."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="link_guest",
        summary="Give a guest's laps to the racer who they are",
        request=LinkGuestSerializer,
        responses=GuestSerializer,
        tags=["timing"],
    )
    def post(self, request: Request, slug: str, id: str) -> Response:
        race = organised_race(request, slug)
        guest = get_object_or_404(guests_of(race).select_related("race", "entry"), pk=uuid_or_404(id))
        alias = read_as(LinkGuestSerializer, request.data)["racer"]
        racer = Racer.objects.filter(alias__iexact=alias).first()
        if racer is None:
            raise UserFault("timekeeper_unknown", racer=alias)
        timing.link_guest(guest=guest, racer=racer, by=racer_of(request), now=timezone.now())
        return Response(GuestSerializer(guests_of(race).get(pk=guest.pk)).data)


class ClaimView(APIView):
    """Laps of a guest who has an account now."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="claim_guest",
        summary="Take over what was timed for you as a guest",
        request=ClaimSerializer,
        responses=EntrySerializer,
        tags=["timing"],
    )
    def post(self, request: Request) -> Response:
        claim = read_as(ClaimSerializer, request.data)["claim"]
        entry = timing.claim_guest(claim=claim, racer=racer_of(request), now=timezone.now())
        return Response(EntrySerializer(entry).data)
