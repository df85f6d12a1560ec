"""API operation of a racer's public profile."""

from django.http import Http404, HttpRequest
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.models import Racer
from accounts.profile.fields import FIELDS
from core.api.documents import serializer_of
from core.api.operations import operation
from core.api.views import APIView

from .selectors import Honours, profile_of, racer_shown


class RacedSerializer(serializers.Serializer):
    """A race of a racer."""

    race = serializers.CharField(source="race.slug")
    name = serializers.CharField(source="race.name")
    rank = serializers.IntegerField(allow_null=True)
    score_ms = serializers.IntegerField(source="entry.score_ms", allow_null=True)
    best_lap_ms = serializers.IntegerField(source="entry.best_lap_ms", allow_null=True)
    run = serializers.CharField(source="entry.best.evaluation.public_id", default=None, allow_null=True)


class CupWonSerializer(serializers.Serializer):
    """A division of a cup that a racer won."""

    day = serializers.DateField(source="cup.day")
    division = serializers.IntegerField()


class SharedModelSerializer(serializers.Serializer):
    """A model that a racer shares."""

    public_id = serializers.CharField()
    name = serializers.CharField()


class OrganisedSerializer(serializers.Serializer):
    """A race that a racer organises."""

    race = serializers.CharField(source="slug")
    name = serializers.CharField()


class ProfileSerializer(serializers.Serializer):
    """The public profile of a racer."""

    alias = serializers.CharField(source="racer.alias")
    honours = serializer_of(Honours)()
    races = RacedSerializer(source="history", many=True, help_text="The latest, as far as the caller may see them.")
    cups_won = CupWonSerializer(source="trophies", many=True)
    shared_models = SharedModelSerializer(source="shared", many=True, help_text="Empty without a log-in.")
    organises = OrganisedSerializer(source="organised", many=True)

    def get_fields(self) -> dict[str, serializers.Field]:
        """Also the public fields."""
        return {**super().get_fields(), **{name: field.api() for name, field in FIELDS.items()}}


def shown_racer(request: HttpRequest | Request, alias: str) -> Racer:
    racer = racer_shown(alias)
    if racer is None:
        raise Http404
    return racer


class RacerView(APIView):
    @operation("read_racer", "The public profile of a racer", find=shown_racer, answer=ProfileSerializer)
    def get(self, request: Request, racer: Racer) -> dict[str, object]:
        profile = profile_of(racer, request.user, timezone.now())
        return {**vars(profile), **profile.fields}
