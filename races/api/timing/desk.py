"""All that a timekeeper's device needs, in one answer."""

from __future__ import annotations

from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from ...selectors.timing import guests_of, sensors_of, who_may_be_timed
from .common import timed_race
from .guests import GuestSerializer
from .sensors import SensorSerializer


class MayBeTimedSerializer(serializers.Serializer):
    """Somebody in the race."""

    racer = serializers.CharField(source="racer.alias")
    name = serializers.CharField(source="shown_name")
    sessions = serializers.IntegerField(source="submission_count")
    model = serializers.CharField(source="model.name", default=None, allow_null=True)


class TimingSerializer(serializers.Serializer):
    """All that a timekeeper's device needs."""

    now = serializers.DateTimeField()
    racers = MayBeTimedSerializer(many=True)
    guests = GuestSerializer(many=True)
    sensors = SensorSerializer(many=True)


class TimingView(APIView):
    """What a timekeeper needs."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_timing",
        summary="Who may be timed, for timekeepers",
        responses=TimingSerializer,
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        race = timed_race(request, slug)
        found = {
            "now": timezone.now(),
            "racers": who_may_be_timed(race).filter(guest_name=""),
            "guests": guests_of(race),
            "sensors": sensors_of(race).filter(revoked_at=None),
        }
        return Response(TimingSerializer(found).data)
