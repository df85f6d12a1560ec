"""The state of the site in the API."""

from rest_framework import serializers
from rest_framework.permissions import AllowAny
from rest_framework.request import Request

from core.api.operations import operation
from core.api.views import APIView

from .status import ServiceStatus, service_status


class ServiceDaySerializer(serializers.Serializer):
    """A day (UTC). Times are null without runs."""

    day = serializers.DateField()
    runs = serializers.IntegerField(help_text="Submissions with a result.")
    p50_ms = serializers.IntegerField(allow_null=True, help_text="From a submission to its result: the median.")
    p95_ms = serializers.IntegerField(allow_null=True, help_text="The 95th percentile.")
    faults = serializers.IntegerField(help_text="Runs with a fault of the platform, which are driven again.")
    given_back = serializers.IntegerField(help_text="Submissions given back after such a fault.")


class StatusSerializer(serializers.Serializer):
    """The state of the site."""

    well = serializers.BooleanField(source="is_well", help_text="Every part works, and no run is stuck.")
    parts = serializers.DictField(child=serializers.BooleanField(), help_text="By name, whether each works.")
    waiting = serializers.IntegerField(help_text="Runs.")
    running = serializers.IntegerField(help_text="Runs.")
    stuck = serializers.IntegerField(help_text="Runs that have waited for more than a minute.")
    days = ServiceDaySerializer(many=True, help_text="The last 30 days, the oldest first.")


class StatusView(APIView):
    permission_classes = [AllowAny]

    @operation("read_status", "How the site is, and how fast results were in 30 days", answer=StatusSerializer)
    def get(self, request: Request) -> ServiceStatus:
        return service_status()
