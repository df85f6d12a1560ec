"""Runs of one's own: ask for one, list them, drive one again. Deleting one is with the other evaluations."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_field, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from evaluation.models import State
from paddock.rules.race import MAX_CARS, OWN_RULES
from tracks.api import NAME_HELP, TrackField
from tracks.selectors import track_named

from .. import services
from ..models import OwnEvaluation, RaceType
from ..rules.serializers import with_rules
from ..selectors.own import own_of, own_runs_of, seen_race_of, usable_model, usable_race, usable_rivals
from .evaluations import EvaluationSerializer, ModelSummarySerializer, NamedSerializer, ReasonSerializer, reason_of
from .lookup import visible_evaluation
from .races import TrackSummarySerializer


class NewOwnSerializer(with_rules(Body, OWN_RULES, rules=OWN_RULES, asked=True)):  # type: ignore[misc]
    """A run: a model on a track with rules, each of which may be left out; or a model as in a race."""

    model = serializers.CharField(max_length=12, help_text="A model of yours, or one that is shared: its public id.")
    track = TrackField(required=False)
    race = serializers.CharField(
        max_length=80, required=False, help_text="Instead of a track and rules: as in this race (its slug), alone."
    )
    rivals = serializers.ListField(
        child=serializers.CharField(max_length=12),
        required=False,
        max_length=MAX_CARS - 1,
        help_text="For head to head: models of yours, shared ones or house cars that race along.",
    )
    submit_if_better = serializers.BooleanField(
        required=False, help_text="Send the car to the race if the run is better than what you have there."
    )


class OwnFilterSerializer(serializers.Serializer):
    """Which runs to list."""

    state = serializers.ChoiceField(State.choices, required=False)
    race_type = serializers.ChoiceField(RaceType.choices, required=False)
    track = serializers.CharField(required=False)
    model = serializers.CharField(required=False)
    race = serializers.CharField(required=False)


class OwnSummarySerializer(serializers.Serializer):
    """A run of one's own in a list; the run itself is an evaluation."""

    public_id = serializers.CharField(source="evaluation.public_id")
    state = serializers.ChoiceField(State.choices, source="evaluation.state")
    model = ModelSummarySerializer(source="evaluation.model")
    track = TrackSummarySerializer(source="evaluation.track")
    race_type = serializers.ChoiceField(RaceType.choices, source="rules.race_type")
    direction = serializers.CharField(source="rules.direction")
    laps = serializers.IntegerField(source="rules.laps")
    race = serializers.SerializerMethodField(help_text="The race that it was driven as in, as long as you see it.")
    complete_laps = serializers.IntegerField(source="evaluation.result.complete_laps", default=None, allow_null=True)
    best_lap_ms = serializers.IntegerField(source="evaluation.result.best_lap_ms", default=None, allow_null=True)
    total_ms = serializers.IntegerField(source="evaluation.result.total_ms", default=None, allow_null=True)
    reason = serializers.SerializerMethodField(help_text="When it failed or was stopped.")
    asked_at = serializers.DateTimeField()

    @extend_schema_field(NamedSerializer(allow_null=True))
    def get_race(self, own: OwnEvaluation) -> dict[str, Any] | None:
        race = seen_race_of(own)
        return None if race is None else NamedSerializer(race).data

    @extend_schema_field(ReasonSerializer(allow_null=True))
    def get_reason(self, own: OwnEvaluation) -> dict[str, Any] | None:
        evaluation = own.evaluation
        assert evaluation is not None, "it is not deleted"
        return reason_of(evaluation.reason_code, evaluation.reason, evaluation.reason_params)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_evaluations",
        summary="Runs of your own",
        description="Those that you asked for; runs in races are listed with their races. The latest first.",
        parameters=[
            OpenApiParameter("state", enum=State.values),
            OpenApiParameter("race_type", enum=RaceType.values),
            OpenApiParameter("track", str, description=NAME_HELP),
            OpenApiParameter("model", str, description="The model's public id."),
            OpenApiParameter("race", str, description="The slug of the race that they were driven as in."),
        ],
        responses=OwnSummarySerializer,
        tags=["evaluations"],
    )
)
class OwnRunsView(generics.ListAPIView):
    """Own runs: list them, ask for one."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]
    serializer_class = OwnSummarySerializer

    def get_queryset(self) -> QuerySet[OwnEvaluation]:
        wanted = read_as(OwnFilterSerializer, self.request.query_params)
        if named := track_named(wanted.get("track", "")):
            wanted["track"] = named.slug
        return own_runs_of(self.request.user, **wanted)

    @extend_schema(
        operation_id="create_evaluation",
        summary="Drive a car: any that you may use, on any track",
        description="Private: only you and admins see it. It waits behind submissions to races, and counts in none.",
        request=NewOwnSerializer,
        responses={201: EvaluationSerializer},
        tags=["evaluations"],
    )
    def post(self, request: Request) -> Response:
        said, racer = read_as(NewOwnSerializer, request.data), racer_of(request)
        if "race" in said:
            said["race"] = usable_race(racer, said["race"])
        said["model"] = usable_model(racer, said["model"])
        said["rivals"] = usable_rivals(racer, said.get("rivals", ()))
        own = services.drive_own(owner=racer, now=timezone.now(), **said)
        return Response(EvaluationSerializer(own.evaluation).data, status=status.HTTP_201_CREATED)


class AgainView(APIView):
    """Driving one again."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="repeat_evaluation",
        summary="Drive a run of your own again",
        description="The same cars by the same rules, or by those that the race has now that it was driven as in.",
        request=None,
        responses={201: EvaluationSerializer},
        tags=["evaluations"],
    )
    def post(self, request: Request, public_id: str) -> Response:
        evaluation = visible_evaluation(request, public_id)
        refuse_fields(request)
        own = own_of(racer_of(request), evaluation)
        again = services.drive_own_again(own=own, now=timezone.now())
        return Response(EvaluationSerializer(again.evaluation).data, status=status.HTTP_201_CREATED)
