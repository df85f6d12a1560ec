"""Trainings: create, read, stop, delete, evaluate. Only the owner and admins have access."""

from typing import Literal, Required, TypedDict

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiTypes, extend_schema_field
from rest_framework import serializers, status
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import TRAIN
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from evaluation.models import Evaluation
from evaluation.selectors import visible_models
from paddock.errors import UserFault
from paddock.packages.metadata import CONTINUOUS, DISCRETE
from paddock.rules.training import DRIVEN_BY, SETTINGS, taken_from
from races.entries.selectors.visibility import races_visible_to
from races.models import RaceType
from races.rules.serializers import with_rules
from races.runs.api.evaluations import EvaluationSerializer
from tracks.api import TrackField
from tracks.models import Track
from training.jobs.exports import training_metrics
from training.jobs.queue_order import place_of
from training.jobs.selectors import how_it_ended, trainings_of, visible_trainings
from training.jobs.services.creation import create_training
from training.jobs.services.deletion import delete_training
from training.jobs.services.queue import stop_training
from training.jobs.services.results import evaluate_training
from training.jobs.settings_checks import DEFAULT_ACTIONS, DEFAULT_BOUNDS
from training.models import Algorithm, EndReason, JobState, NeuralNetwork, RewardSignature, TrainingJob
from training.quotas import bytes_of
from training.rewards.check_slots import refusals
from training.rewards.sandbox.static_checks import MAX_CHARACTERS
from training.vehicles.services import vehicles_of


class TrainingSummarySerializer(serializers.Serializer):
    """A training in a list."""

    public_id = serializers.CharField()
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    state = serializers.ChoiceField(JobState.choices)
    track = serializers.CharField(source="track.slug")
    race_type = serializers.ChoiceField(RaceType.choices)
    algorithm = serializers.ChoiceField(Algorithm.choices)
    steps = serializers.IntegerField(source="steps_done", help_text="Control steps driven.")
    training_s = serializers.FloatField(source="seconds_done", help_text="Wall time of training so far.")
    charged_s = serializers.FloatField(
        help_text="What counts of its minutes: from each claim by a trainer to its end; of an attempt that was lost "
        "through no fault of its own what a checkpoint has kept."
    )
    ended_because = serializers.ChoiceField(
        EndReason.choices, allow_blank=True, help_text="Which of these ended it; empty while nothing has."
    )
    reason_code = serializers.CharField(
        allow_blank=True, help_text="Why it failed. Of one that waits: it has failed, and its models are kept yet."
    )
    best_model = serializers.CharField(source="best_model.public_id", default=None, allow_null=True)
    last_model = serializers.CharField(source="last_model.public_id", default=None, allow_null=True)
    created_at = serializers.DateTimeField()
    started_at = serializers.DateTimeField(allow_null=True)
    ended_at = serializers.DateTimeField(allow_null=True)


class IterationSerializer(serializers.Serializer):
    """One update of the policy, and the evaluation that followed it."""

    number = serializers.IntegerField()
    steps = serializers.IntegerField()
    training_s = serializers.FloatField(source="seconds")
    steps_per_second = serializers.FloatField()
    mean_reward = serializers.FloatField(allow_null=True)
    mean_progress = serializers.FloatField(allow_null=True, help_text="Percent of a lap.")
    eval_reward = serializers.FloatField()
    eval_progress = serializers.FloatField(help_text="Percent of a lap, without exploring.")
    eval_lap_ms = serializers.IntegerField(allow_null=True)
    eval_clean_laps = serializers.IntegerField()
    entropy = serializers.FloatField(allow_null=True)
    policy_loss = serializers.FloatField(allow_null=True)
    value_loss = serializers.FloatField(allow_null=True)
    is_best = serializers.BooleanField()


class TrainingSerializer(with_rules(with_rules(TrainingSummarySerializer, DRIVEN_BY), SETTINGS, rules=SETTINGS)):  # type: ignore[misc]
    """A training with its settings and its iterations."""

    owner = serializers.CharField(source="owner.alias")
    ending = serializers.SerializerMethodField(help_text="Why it ended, as a sentence; empty while it has not.")
    reason = serializers.CharField(allow_blank=True, help_text="The sentence of `reason_code`.")
    queue_position = serializers.SerializerMethodField(help_text="1: the next one.")
    stop_asked = serializers.SerializerMethodField(help_text="It has been asked to stop.")
    more_tracks = serializers.SerializerMethodField(help_text="Slugs of the tracks that it drives on besides.")
    hyperparameters = serializers.DictField()
    action_space_type = serializers.CharField()
    action_space = serializers.JSONField()
    sensors = serializers.ListField(child=serializers.CharField())
    neural_network = serializers.ChoiceField(NeuralNetwork.choices)
    reward_code = serializers.CharField()
    cloned_from = serializers.CharField(source="cloned_from.public_id", default=None, allow_null=True)
    submit_to_race = serializers.CharField(source="submit_to_race.slug", default=None, allow_null=True)
    evaluation = serializers.CharField(
        source="submission.evaluation.public_id", default=None, allow_null=True, help_text="Of what was submitted."
    )
    submit_reason_code = serializers.CharField(allow_blank=True, help_text="Why it was not submitted.")
    evaluate_on = serializers.CharField(source="evaluate_on.slug", default=None, allow_null=True)
    own_evaluation = serializers.CharField(
        source="own_evaluation.evaluation.public_id",
        default=None,
        allow_null=True,
        help_text="Of the best model on the track of `evaluate_on`.",
    )
    evaluate_reason_code = serializers.CharField(allow_blank=True, help_text="Why it was not driven there.")
    stored_bytes = serializers.SerializerMethodField(
        help_text="What its files weigh, without the networks of its models: so much is free when it is deleted."
    )
    printed = serializers.CharField(
        allow_blank=True, help_text="The newest lines that the reward function printed, at most 2,000 characters."
    )
    iterations = serializers.SerializerMethodField()

    def get_more_tracks(self, job: TrainingJob) -> list[str]:
        return [track.slug for track in job.tracks[1:]]

    def get_ending(self, job: TrainingJob) -> str:
        return how_it_ended(job, self.context["request"].user)

    def get_queue_position(self, job: TrainingJob) -> int | None:
        return place_of(job, timezone.now())

    def get_stored_bytes(self, job: TrainingJob) -> int:
        return bytes_of(job)

    def get_stop_asked(self, job: TrainingJob) -> bool:
        return job.stop_asked_at is not None

    @extend_schema_field(IterationSerializer(many=True))
    def get_iterations(self, job: TrainingJob) -> list[dict[str, object]]:
        rows = job.iterations.order_by("number").defer("episodes", "eval_trials", "simtrace")
        return list(IterationSerializer(rows, many=True).data)


class SentTraining(TypedDict, total=False):
    """The fields of a body that are read here; all fields become settings and fields of the training."""

    reward_code: Required[str]
    race_type: str
    algorithm: str
    clone_from: str
    vehicle: str
    submit_to_race: str


class CreateSerializer(
    with_rules(with_rules(Body, DRIVEN_BY, asked=True, strict=True), SETTINGS, rules=SETTINGS, asked=True)  # type: ignore[misc]
):
    """What is to be trained. What is left out has its usual value."""

    name = serializers.CharField(max_length=64, help_text="1 to 64 English letters, digits and hyphens.")
    description = serializers.CharField(required=False, allow_blank=True, max_length=255)
    track = TrackField(queryset=Track.objects.exclude(length_m=None))
    more_tracks = TrackField(
        queryset=Track.objects.exclude(length_m=None),
        many=True,
        required=False,
        help_text="Slugs of up to 7 more: each episode drives on one of all tracks, each evaluation on every one.",
    )
    algorithm = serializers.ChoiceField(Algorithm.choices, required=False)
    hyperparameters = serializers.DictField(required=False)
    action_space_type = serializers.ChoiceField(["discrete", "continuous"], required=False)
    action_space = serializers.JSONField(required=False, help_text="As in model_metadata.json.")
    vehicle = serializers.CharField(required=False, max_length=12, help_text="The public_id of one of your vehicles.")
    reward_code = serializers.CharField(trim_whitespace=False, max_length=MAX_CHARACTERS)
    clone_from = serializers.CharField(
        required=False,
        max_length=12,
        help_text="The public_id of a model, yours or shared, whose weights it begins with. Its action space and "
        "algorithm are taken over unless one of them is sent.",
    )
    submit_to_race = serializers.CharField(required=False, max_length=80, help_text="The slug of a race.")
    evaluate_on = TrackField(
        queryset=Track.objects.exclude(length_m=None),
        required=False,
        help_text="The slug of a track on which the best model is driven for you when it is done: three laps.",
    )


def visible_training(request: Request, public_id: str) -> TrainingJob:
    """The training with this id. Raises Http404 if the reader may not see it."""
    related = ("owner", "track", "best_model", "last_model", "cloned_from", "submit_to_race", "submission__evaluation")
    own = ("evaluate_on", "own_evaluation__evaluation")
    return get_object_or_404(visible_trainings(request.user).select_related(*related, *own), public_id=public_id)


def own_training(request: Request, public_id: str) -> TrainingJob:
    job = visible_training(request, public_id)
    if job.owner_id != request.user.pk:
        raise Http404
    return job


class TrainingsView(PrivateView):
    token_scope = TRAIN
    slow_methods = ("POST",)

    @operation("list_trainings", "My trainings", answer=TrainingSummarySerializer, paged=True)
    def get(self, request: Request) -> QuerySet[TrainingJob]:
        return trainings_of(request.user)

    @operation(
        "create_training",
        "Begin a training",
        body=CreateSerializer,
        answer={201: TrainingSerializer},
        description="Checks the reward function as the wizard does, and puts the training into the queue.",
    )
    def post(self, request: Request, sent: SentTraining) -> Response:
        asked, rest = taken_from(checked_settings(request, sent))

        def make() -> Response:
            job = create_training(owner=racer_of(request), settings=asked, now=timezone.now(), **rest)
            return Response(TrainingSerializer(job, context={"request": request}).data, status=status.HTTP_201_CREATED)

        return self.write(make)


class DeletionQuery(serializers.Serializer):
    """What else is deleted."""

    models = serializers.BooleanField(default=False, help_text="Its models, too.")


class TrainingView(PrivateView):
    token_scope = TRAIN

    @operation("read_training", "A training", find=visible_training, answer=TrainingSerializer)
    def get(self, request: Request, job: TrainingJob) -> TrainingJob:
        return job

    @operation(
        "delete_training",
        "Delete a training that is over",
        find=own_training,
        query=DeletionQuery,
        answer="Deleted; `stored_bytes` are free again.",
        description="Its files, graph, log and reward function are gone for good; its minutes still count this month. "
        "Its models stay in the garage unless `models` is true; what results need of them is kept in any case.",
    )
    def delete(self, request: Request, job: TrainingJob, asked: dict[str, bool]) -> None:
        delete_training(job=job, with_models=asked["models"], now=timezone.now())


class TrainingStopView(APIView):
    token_scope = TRAIN

    @operation(
        "stop_training",
        "Stop a training",
        find=visible_training,
        answer=TrainingSerializer,
        description="What it has learned stays. Stopping one that is over changes nothing.",
    )
    def post(self, request: Request, job: TrainingJob) -> TrainingJob:
        stop_training(job=job, by=racer_of(request), now=timezone.now())
        return visible_training(request, job.public_id)


class EvaluateBody(Body):
    """Which of its models."""

    model = serializers.ChoiceField(["best", "last"], default="best")


class TrainingEvaluationsView(APIView):
    token_scope = TRAIN

    @operation(
        "evaluate_training",
        "Drive the best or the last model of a training by the referee of races",
        find=own_training,
        body=EvaluateBody,
        answer=EvaluationSerializer,
        status=201,
        description="Three laps on the track and the layout that it was trained on. The evaluation is seen by you "
        "and by admins, and stands on no board.",
    )
    def post(self, request: Request, job: TrainingJob, sent: dict[str, Literal["best", "last"]]) -> Evaluation:
        return evaluate_training(job=job, which=sent["model"], by=racer_of(request), now=timezone.now())


class TrainingMetricsView(PrivateView):
    @operation(
        "training_metrics",
        "Training metrics JSON, in the field's own form",
        find=visible_training,
        answer={200: OpenApiTypes.OBJECT},
    )
    def get(self, request: Request, job: TrainingJob) -> Response:
        return Response(training_metrics(job))


def checked_settings(request: Request, sent: SentTraining) -> dict[str, object]:
    """What :func:`taken_from` takes. Raises Http404, ValidationError, UserFault."""
    kwargs = dict(sent)
    kwargs["reward_code"] = code = sent["reward_code"].replace("\r\n", "\n")
    kwargs["reward_signature"] = RewardSignature.of(code)
    if "clone_from" in sent:
        model = kwargs["clone_from"] = visible_models(request.user).filter(public_id=sent["clone_from"]).first()
        if model is None:
            raise UserFault("clone_not_yours")
        if not sent.keys() & {"action_space", "action_space_type", "algorithm"}:  # those that it was trained with
            kwargs |= {name: model.metadata[name] for name in ("action_space", "action_space_type")}
            kwargs["algorithm"] = Algorithm.SAC if model.metadata["training_algorithm"] == "sac" else Algorithm.PPO
    kind = kwargs.setdefault("action_space_type", CONTINUOUS if sent.get("algorithm") == Algorithm.SAC else DISCRETE)
    usual = DEFAULT_BOUNDS if kind == CONTINUOUS else [dict(action) for action in DEFAULT_ACTIONS]
    kwargs.setdefault("action_space", usual)
    if "vehicle" in sent:
        kwargs["vehicle"] = vehicles_of(request.user).filter(public_id=sent["vehicle"]).first()
        if kwargs["vehicle"] is None:
            raise UserFault("vehicle_not_yours")
    if "submit_to_race" in sent:
        kwargs["submit_to_race"] = get_object_or_404(races_visible_to(request.user), slug=sent["submit_to_race"])
    for fault in refusals(racer_of(request), code, sent.get("race_type", RaceType.TIME_TRIAL)):
        raise fault
    return kwargs
