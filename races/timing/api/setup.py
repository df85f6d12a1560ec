"""The API of a timed race's timekeepers, sensors and guests."""

from typing import Any
from uuid import UUID

from django.http import Http404
from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.models import Racer
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE, RACE
from core.api.bodies import Body
from core.api.fields import ComputedField
from core.api.operations import operation
from core.api.views import PrivateView
from paddock.errors import UserFault

from ...models import Entry, Guest, Race, Timekeeper, TimingSensor
from ...web.api import organised_race, visible_race
from ...web.serializers import EntrySerializer
from .. import services as timing
from ..selectors import can_keep_time, guests_of, sensors_of, timekeepers_of

DAY_MS = 86_400_000


class OrganisersView(PrivateView):
    """Operations of a race's organiser."""

    tag = "timing"
    token_scope = ORGANISE


def uuid_or_404(text: str) -> UUID:
    """Raises Http404 for an invalid UUID."""
    try:
        return UUID(text)
    except ValueError:
        raise Http404 from None


def timed_race(request: Request, slug: str) -> Race:
    """The race at ``slug``, in which the reader may take times. Raises Http404, UserFault("race_not_physical" |
    "timing_not_yours")."""
    race = visible_race(request, slug)
    if not race.physical:
        raise UserFault("race_not_physical")
    if not can_keep_time(racer_of(request), race):
        raise UserFault("timing_not_yours")
    return race


class TimekeeperSerializer(serializers.Serializer):
    """A racer with the right to take times in a race."""

    racer = serializers.CharField(source="racer.alias")
    named_at = serializers.DateTimeField()


class NameTimekeeperSerializer(Body):
    """The racer to name as timekeeper."""

    racer = serializers.CharField(max_length=64)


class SensorSerializer(serializers.Serializer):
    """A sensor at the finish line."""

    number = serializers.IntegerField(source="pk")
    name = serializers.CharField()
    hint = serializers.CharField(help_text="How its token begins.")
    made_at = serializers.DateTimeField()
    seen_at = serializers.DateTimeField(allow_null=True)
    revoked_at = serializers.DateTimeField(allow_null=True)


class NewSensorSerializer(Body):
    """The new sensor's name."""

    name = serializers.CharField(max_length=64)


class MadeSensorSerializer(SensorSerializer):
    """A new sensor with its token."""

    token = serializers.CharField(help_text="Shown this once.")


class GuestSerializer(serializers.Serializer):
    """A guest of the race."""

    id = serializers.UUIDField()
    name = serializers.CharField()
    racer = ComputedField(
        serializers.CharField(allow_null=True),
        lambda guest: guest.entry.racer.alias if guest.linked_at else None,
        help_text="Who has taken the laps over; null for nobody yet.",
    )


class OrganisersGuestSerializer(GuestSerializer):
    """A guest with the secret that their laps are taken over with."""

    claim = serializers.SerializerMethodField(help_text="To hand to the guest; null once the laps are taken over.")
    claim_url = serializers.SerializerMethodField(help_text="The page for it.")

    def get_claim(self, guest: Guest) -> str | None:
        return None if guest.linked_at else guest.claim

    def get_claim_url(self, guest: Guest) -> str | None:
        request: Request = self.context["request"]
        return None if guest.linked_at else request.build_absolute_uri(reverse("guest_claim", args=[guest.claim]))


class LinkGuestSerializer(Body):
    """The racer to whom the guest's laps go."""

    racer = serializers.CharField(max_length=64, help_text="Alias.")


class ClaimSerializer(Body):
    """What the organiser has handed to the guest."""

    claim = serializers.CharField(max_length=64, help_text="The secret, which is also the end of the link's address.")


def organised_timekeeper(request: Request, slug: str, alias: str) -> Timekeeper:
    """A timekeeper of a race that the caller organises. Raises as :func:`organised_race`."""
    return get_object_or_404(timekeepers_of(organised_race(request, slug)), racer__alias__iexact=alias)


def organised_sensor(request: Request, slug: str, number: int) -> TimingSensor:
    """A sensor of a race that the caller organises. Raises as :func:`organised_race`."""
    return get_object_or_404(TimingSensor, race=organised_race(request, slug), pk=number)


def organised_guest(request: Request, slug: str, id: str) -> Guest:
    """A guest of a race that the caller organises. Raises as :func:`organised_race`."""
    guests = guests_of(organised_race(request, slug)).select_related("race", "entry")
    return get_object_or_404(guests, pk=uuid_or_404(id))


class TimekeepersView(OrganisersView):
    """The timekeepers of a race."""

    @operation(
        "list_timekeepers",
        "Timekeepers of a race that you organise",
        find=organised_race,
        answer=TimekeeperSerializer,
        many=True,
    )
    def get(self, request: Request, race: Race) -> Any:
        return timekeepers_of(race)

    @operation(
        "name_timekeeper",
        "Name a timekeeper",
        find=organised_race,
        body=NameTimekeeperSerializer,
        answer=TimekeeperSerializer,
    )
    def post(self, request: Request, race: Race, sent: dict) -> Timekeeper:
        return timing.name_timekeeper(race=race, alias=sent["racer"], by=racer_of(request), now=timezone.now())


class TimekeeperView(OrganisersView):
    """One timekeeper."""

    @operation(
        "dismiss_timekeeper",
        "Dismiss a timekeeper",
        find=organised_timekeeper,
        answer="Dismissed; what they timed stays.",
    )
    def delete(self, request: Request, timekeeper: Timekeeper) -> None:
        timing.dismiss_timekeeper(race=timekeeper.race, racer=timekeeper.racer, by=racer_of(request))


class SensorsView(OrganisersView):
    """The sensors of a race."""

    @operation(
        "list_sensors", "Sensors of a race that you organise", find=organised_race, answer=SensorSerializer, many=True
    )
    def get(self, request: Request, race: Race) -> Any:
        return sensors_of(race)

    @operation(
        "make_sensor",
        "Make a sensor and its token",
        find=organised_race,
        body=NewSensorSerializer,
        answer=MadeSensorSerializer,
        status=201,
    )
    def post(self, request: Request, race: Race, sent: dict) -> TimingSensor:
        sensor, text = timing.make_sensor(race=race, by=racer_of(request), now=timezone.now(), **sent)
        sensor.token = text  # type: ignore[attr-defined]
        return sensor


class SensorView(OrganisersView):
    """One sensor."""

    @operation(
        "revoke_sensor", "Revoke a sensor's token", find=organised_sensor, answer="Revoked; what it timed stays."
    )
    def delete(self, request: Request, sensor: TimingSensor) -> None:
        timing.revoke_sensor(sensor=sensor, by=racer_of(request), now=timezone.now())


class GuestsView(PrivateView):
    """The guests of a race."""

    tag = "timing"

    @operation(
        "list_guests",
        "Guests of a race that you organise, with the secrets that they take their laps over with",
        find=organised_race,
        answer=OrganisersGuestSerializer,
        many=True,
    )
    def get(self, request: Request, race: Race) -> Any:
        return guests_of(race)


class GuestView(OrganisersView):
    """One guest."""

    @operation(
        "link_guest",
        "Give a guest's laps to the racer who they are",
        find=organised_guest,
        body=LinkGuestSerializer,
        answer=GuestSerializer,
    )
    def post(self, request: Request, guest: Guest, sent: dict) -> Guest:
        racer = Racer.objects.filter(alias__iexact=sent["racer"]).first()
        if racer is None:
            raise UserFault("timekeeper_unknown", racer=sent["racer"])
        timing.link_guest(guest=guest, racer=racer, by=racer_of(request), now=timezone.now())
        return guests_of(guest.race).get(pk=guest.pk)


class ClaimView(PrivateView):
    """Laps driven as a guest, of a racer with an account."""

    tag = "timing"
    token_scope = RACE

    @operation(
        "claim_guest", "Take over what was timed for you as a guest", body=ClaimSerializer, answer=EntrySerializer
    )
    def post(self, request: Request, sent: dict) -> Entry:
        return timing.claim_guest(claim=sent["claim"], racer=racer_of(request), now=timezone.now())
