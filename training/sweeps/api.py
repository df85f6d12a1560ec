"""Sweeps: create, list, read, stop, delete. Only the owner and admins have access."""

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers, status
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from paddock.rules.training import taken_from
from races.models import RaceType

from ..jobs.api.trainings import CreateSerializer, SentTraining, checked_settings
from ..models import Sweep, SweepState
from ..models.sweep import SETTINGS_LEAST, SETTINGS_MOST
from ..rewards.check_slots import refusals
from ..rewards.sandbox.static_checks import MAX_CHARACTERS
from .halving import plan
from .selectors import STATES, TrialRow, importances, rows_of, sweeps_of, visible_sweeps
from .services import SearchFields, create_sweep, delete_sweep, stop_sweep
from .space import VARIANTS_MOST


class SweepSummarySerializer(serializers.Serializer):
    """A sweep in a list."""

    public_id = serializers.CharField()
    name = serializers.CharField()
    state = serializers.ChoiceField(SweepState.choices)
    settings = serializers.IntegerField(source="settings_count", help_text="How many settings it tries.")
    budget_s = serializers.IntegerField(help_text="Seconds of training that all trials share.")
    reason_code = serializers.CharField(allow_blank=True, help_text="Why it failed.")
    best_model = serializers.CharField(
        source="best.job.best_model.public_id", default=None, allow_null=True, help_text="The best trial's model."
    )
    created_at = serializers.DateTimeField()
    ended_at = serializers.DateTimeField(allow_null=True)


class RungSerializer(serializers.Serializer):
    """A rung of the plan."""

    trials = serializers.IntegerField()
    seconds = serializers.FloatField(help_text="Of each trial in this rung, if none fails.")


class ImportanceSerializer(serializers.Serializer):
    """How much one dimension mattered."""

    name = serializers.CharField(help_text="A hyperparameter, `action_space` or `reward_function`.")
    share = serializers.FloatField(
        help_text="0 to 1: of the differences in rank after the first rung, what this one alone explains."
    )


class SettingSerializer(serializers.Serializer):
    """A point of the search space."""

    hyperparameters = serializers.DictField()
    action_space = serializers.IntegerField(help_text="Index into the action spaces; 0 is the base training's.")
    reward_function = serializers.IntegerField(help_text="Index into the reward functions; 0 is the base training's.")


class TrialSerializer(serializers.Serializer):
    """A trial with its best evaluation so far."""

    number = serializers.IntegerField(source="trial.number", help_text="1 has the base settings.")
    setting = SettingSerializer(source="trial.setting")
    state = serializers.ChoiceField(STATES)
    rung = serializers.IntegerField()
    training_s = serializers.FloatField(source="trial.job.seconds_done")
    progress = serializers.FloatField(allow_null=True, help_text="Percent of a lap.")
    lap_ms = serializers.IntegerField(allow_null=True)
    training = serializers.CharField(source="trial.job.public_id", help_text="Its training.")


class SweepSerializer(SweepSummarySerializer):
    """A sweep with its trials."""

    owner = serializers.CharField(source="owner.alias")
    reason = serializers.CharField(allow_blank=True, help_text="The sentence of `reason_code`.")
    stop_asked = serializers.SerializerMethodField(help_text="It has been asked to stop.")
    space = serializers.JSONField(help_text="What the trials differ in.")
    plan = serializers.SerializerMethodField()
    trials = serializers.SerializerMethodField()
    importances = serializers.SerializerMethodField(help_text="Empty before three trials finished the first rung.")

    def _rows(self, sweep: Sweep) -> list[TrialRow]:
        if not hasattr(self, "_read"):
            self._read = rows_of(sweep)
        return self._read

    def get_stop_asked(self, sweep: Sweep) -> bool:
        return sweep.stop_asked_at is not None

    @extend_schema_field(RungSerializer(many=True))
    def get_plan(self, sweep: Sweep) -> list[dict[str, object]]:
        return list(RungSerializer(plan(sweep.settings_count, sweep.budget_s), many=True).data)

    @extend_schema_field(TrialSerializer(many=True))
    def get_trials(self, sweep: Sweep) -> list[dict[str, object]]:
        return list(TrialSerializer(self._rows(sweep), many=True).data)

    @extend_schema_field(ImportanceSerializer(many=True))
    def get_importances(self, sweep: Sweep) -> list[dict[str, object]]:
        return list(ImportanceSerializer(importances(sweep, self._rows(sweep)), many=True).data)


class ActionSpaceBody(Body):
    """Another action space."""

    action_space_type = serializers.ChoiceField(["discrete", "continuous"])
    action_space = serializers.JSONField(help_text="As in model_metadata.json.")


class SearchBody(Body):
    """What the trials differ in; at least one of these."""

    hyperparameters = serializers.DictField(
        child=serializers.DictField(),
        required=False,
        help_text='`{"low", "high"}` or `{"choices"}` by name. A range of a factor of ten or more is logarithmic.',
    )
    action_spaces = ActionSpaceBody(many=True, required=False, help_text="Beside the base training's.")
    reward_functions = serializers.ListField(
        child=serializers.CharField(trim_whitespace=False, max_length=MAX_CHARACTERS),
        required=False,
        max_length=VARIANTS_MOST,
        help_text="Beside the base training's.",
    )


class SentSweep(SentTraining, total=False):
    settings: int
    budget_s: int
    search: SearchFields


class CreateSweepSerializer(CreateSerializer):
    """The base training as in `create_training`, without limits of its own, and what to try."""

    stop_minutes = None
    stop_steps = None
    stop_clean_laps = None
    settings = serializers.IntegerField(min_value=SETTINGS_LEAST, max_value=SETTINGS_MOST)
    budget_s = serializers.IntegerField(min_value=1, help_text="Seconds of training that all trials share.")
    search = SearchBody()


def visible_sweep(request: Request, public_id: str) -> Sweep:
    """The sweep with this id. Raises Http404 if the reader may not see it."""
    related = ("owner", "best__job__best_model")
    return get_object_or_404(visible_sweeps(request.user).select_related(*related), public_id=public_id)


def own_sweep(request: Request, public_id: str) -> Sweep:
    sweep = visible_sweep(request, public_id)
    if sweep.owner_id != request.user.pk:
        raise Http404
    return sweep


class SweepsView(PrivateView):
    token_scope = TRAIN
    slow_methods = ("POST",)

    @operation("list_sweeps", "My sweeps", answer=SweepSummarySerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Sweep]:
        return sweeps_of(request.user)

    @operation(
        "create_sweep",
        "Try several settings",
        body=CreateSweepSerializer,
        answer={201: SweepSerializer},
        description="Checks every reward function, and begins with the base settings. The budget counts as the time "
        "limit of one training.",
    )
    def post(self, request: Request, sent: SentSweep) -> Response:
        count, budget_s, search = sent.pop("settings"), sent.pop("budget_s"), sent.pop("search")
        asked, rest = taken_from(checked_settings(request, sent))
        for code in search.get("reward_functions", ()):
            for fault in refusals(racer_of(request), code, sent.get("race_type", RaceType.TIME_TRIAL)):
                raise fault

        def make() -> Response:
            by, now = racer_of(request), timezone.now()
            sweep = create_sweep(
                owner=by, settings=asked, count=count, budget_s=budget_s, search=search, now=now, **rest
            )
            return Response(SweepSerializer(sweep).data, status=status.HTTP_201_CREATED)

        return self.write(make)


class SweepView(PrivateView):
    token_scope = TRAIN

    @operation("read_sweep", "A sweep", find=visible_sweep, answer=SweepSerializer)
    def get(self, request: Request, sweep: Sweep) -> Sweep:
        return sweep

    @operation(
        "delete_sweep", "Delete a sweep that is over", find=own_sweep, answer="Its trials are deleted; models stay."
    )
    def delete(self, request: Request, sweep: Sweep) -> None:
        delete_sweep(sweep=sweep, now=timezone.now())


class SweepStopView(APIView):
    token_scope = TRAIN

    @operation(
        "stop_sweep",
        "Stop a sweep",
        find=visible_sweep,
        answer=SweepSerializer,
        description="The best trial so far becomes a model. Stopping one that is over changes nothing.",
    )
    def post(self, request: Request, sweep: Sweep) -> Sweep:
        stop_sweep(sweep=sweep, by=racer_of(request), now=timezone.now())
        return visible_sweep(request, sweep.public_id)
