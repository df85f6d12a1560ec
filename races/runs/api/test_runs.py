"""Runs of one's own: start, list and repeat them; the API of evaluations deletes them."""

from django.db.models import QuerySet
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ComputedField, ReasonField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from evaluation.garage.api import ModelSummarySerializer
from evaluation.models import Evaluation, State
from paddock.rules.race import MAX_CARS, OWN_RULES
from tracks.api import NAME_HELP, TrackField
from tracks.selectors import track_named

from ...models import OwnEvaluation, RaceType
from ...rules.serializers import with_rules
from ...test_runs.selectors import own_runs_of, seen_race_of, usable_model, usable_race, usable_rivals
from ...test_runs.services import drive_own, drive_own_again
from ...web.serializers import NamedSerializer, TrackSummarySerializer
from .evaluations import EvaluationSerializer, own_run


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
    track = serializers.CharField(required=False, help_text=NAME_HELP)
    model = serializers.CharField(required=False, help_text="The model's public id.")
    race = serializers.CharField(required=False, help_text="The slug of the race that they were driven as in.")


class OwnSummarySerializer(serializers.Serializer):
    """A run of one's own in a list; the run itself is an evaluation."""

    public_id = serializers.CharField(source="evaluation.public_id")
    state = serializers.ChoiceField(State.choices, source="evaluation.state")
    model = ModelSummarySerializer(source="evaluation.model")
    track = TrackSummarySerializer(source="evaluation.track")
    race_type = serializers.ChoiceField(RaceType.choices, source="rules.race_type")
    direction = serializers.CharField(source="rules.direction")
    laps = serializers.IntegerField(source="rules.laps")
    race = ComputedField(
        NamedSerializer(allow_null=True),
        seen_race_of,
        help_text="The race that it was driven as in, as long as you see it.",
    )
    complete_laps = serializers.IntegerField(source="evaluation.result.complete_laps", default=None, allow_null=True)
    best_lap_ms = serializers.IntegerField(source="evaluation.result.best_lap_ms", default=None, allow_null=True)
    total_ms = serializers.IntegerField(source="evaluation.result.total_ms", default=None, allow_null=True)
    reason = ReasonField(source="evaluation", help_text="When it failed or was stopped.")
    asked_at = serializers.DateTimeField()


class OwnRunsView(PrivateView):
    token_scope = RACE

    @operation(
        "list_evaluations",
        "Your test runs",
        query=OwnFilterSerializer,
        answer=OwnSummarySerializer,
        paged=True,
        description="Latest first. Runs in races are listed with their races.",
    )
    def get(self, request: Request, wanted: dict[str, str]) -> QuerySet[OwnEvaluation]:
        if named := track_named(wanted.get("track", "")):
            wanted["track"] = named.slug
        return own_runs_of(request.user, **wanted)

    @operation(
        "create_evaluation",
        "Start a test run of any car that you may use, on any track",
        body=NewOwnSerializer,
        answer=EvaluationSerializer,
        status=201,
        description="Private: only you and admins see it. It waits behind submissions to races, and counts in none.",
    )
    def post(self, request: Request, options: dict) -> Evaluation | None:
        racer = racer_of(request)
        if "race" in options:
            options["race"] = usable_race(racer, options["race"])
        options["model"] = usable_model(racer, options["model"])
        options["rivals"] = usable_rivals(racer, options.get("rivals", ()))
        return drive_own(owner=racer, now=timezone.now(), **options).evaluation


class AgainView(APIView):
    token_scope = RACE

    @operation(
        "repeat_evaluation",
        "Repeat one of your test runs",
        find=own_run,
        answer=EvaluationSerializer,
        status=201,
        description="The same cars by the same rules; a run as in a race takes the race's present rules.",
    )
    def post(self, request: Request, own: OwnEvaluation) -> Evaluation | None:
        return drive_own_again(own=own, now=timezone.now()).evaluation
