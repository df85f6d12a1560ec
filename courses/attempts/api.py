"""Attempts: list, hand in, read, give back; reference rows."""

from typing import Any

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE, RACE
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import PrivateView
from evaluation.models import TrainedModel
from evaluation.selectors import visible_models
from paddock.errors import UserFault

from ..assignments.api import taught_assignment, visible_assignment
from ..grading.members import can_teach_group
from ..models import Assignment, Attempt, ReferenceRow, RefundKind, RunState
from . import services
from .selectors import attempts_visible_to, with_runs


class AttemptRunSerializer(serializers.Serializer):
    """A run of an attempt on one track."""

    part = serializers.IntegerField(source="part_track.part.number")
    track = serializers.CharField(source="part_track.track.slug")
    state = serializers.ChoiceField(RunState.choices)
    evaluation = serializers.CharField(source="evaluation.public_id", default=None, allow_null=True)
    laps = serializers.ListField(child=serializers.DictField(), help_text="As in the result of the run.")
    ended_at = serializers.DateTimeField(allow_null=True)


class AttemptSerializer(serializers.Serializer):
    """An attempt of a student or of their submission group."""

    public_id = serializers.CharField()
    assignment = serializers.CharField(source="assignment.public_id")
    racer = serializers.CharField(source="racer.alias")
    submission_group = serializers.CharField(source="submission_group.name", default=None, allow_null=True)
    number = serializers.IntegerField()
    model = serializers.CharField(source="model.public_id")
    model_name = serializers.CharField()
    is_reference = serializers.BooleanField(help_text="Of a reference row: neither ranked nor marked.")
    accepted_at = serializers.DateTimeField(help_text="Decides whether it is in time.")
    refunded_at = serializers.DateTimeField(allow_null=True, help_text="Given back: it does not count.")
    refund_kind = serializers.ChoiceField(RefundKind.choices, allow_blank=True)
    refund_reason = serializers.CharField(allow_blank=True)
    runs = AttemptRunSerializer(many=True)


class AttemptBody(Body):
    """A model of your garage."""

    model = serializers.CharField(max_length=12, help_text="The id of the model.")


class RefundBody(Body):
    """Why an attempt is given back."""

    reason = serializers.CharField(max_length=200)


class ReferenceSerializer(serializers.Serializer):
    """A car on the board that is neither ranked nor marked."""

    number = serializers.IntegerField(source="pk")
    name = serializers.CharField(source="label")
    attempt = serializers.CharField(source="attempt.public_id")


class ReferenceBody(Body):
    """A car of yours, a shared one or a house car."""

    name = serializers.CharField(max_length=40)
    model = serializers.CharField(max_length=12, help_text="The id of the model.")


def visible_attempt(request: Any, public_id: str) -> Attempt:
    """Raises Http404 for an attempt that the caller may not see."""
    return get_object_or_404(with_runs(attempts_visible_to(request.user)), public_id=public_id)


def taught_attempt(request: Any, public_id: str) -> Attempt:
    """Raises as :func:`visible_attempt`, and UserFault("assignment_not_yours") for students."""
    attempt = visible_attempt(request, public_id)
    if not can_teach_group(request.user, attempt.assignment.group):
        raise UserFault("assignment_not_yours")
    return attempt


def shown_reference(request: Any, public_id: str, number: int) -> ReferenceRow:
    """Raises Http404, UserFault("assignment_not_yours")."""
    rows = taught_assignment(request, public_id).reference_rows.select_related("assignment__group", "attempt")
    return get_object_or_404(rows, pk=number)


def _model(request: Request, public_id: str) -> TrainedModel:
    model = visible_models(request.user).filter(public_id=public_id).first()
    if model is None:
        raise UserFault("own_model_gone")
    return model


class AttemptsView(PrivateView):
    token_scope = RACE

    @operation(
        "list_attempts",
        "Attempts of an assignment, the newest first",
        find=visible_assignment,
        answer=AttemptSerializer,
        paged=True,
        description="Your own and your submission group's; for teachers those of all students.",
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[Attempt]:
        return with_runs(attempts_visible_to(request.user).filter(assignment=assignment))

    @operation(
        "hand_in",
        "Hand in a model",
        find=visible_assignment,
        body=AttemptBody,
        answer=AttemptSerializer,
        status=201,
        description="It is in time by the moment of this request, however long its runs wait.",
    )
    def post(self, request: Request, assignment: Assignment, sent: dict[str, str]) -> Attempt:
        now = timezone.now()
        model = _model(request, sent["model"])
        made = services.submit_attempt(assignment=assignment, racer=racer_of(request), model=model, now=now)
        return visible_attempt(request, made.public_id)


class AttemptView(PrivateView):
    @operation("read_attempt", "An attempt with its runs", find=visible_attempt, answer=AttemptSerializer)
    def get(self, request: Request, attempt: Attempt) -> Attempt:
        return attempt


class RefundView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "refund_attempt",
        "Give an attempt back",
        find=taught_attempt,
        body=RefundBody,
        answer=AttemptSerializer,
    )
    def post(self, request: Request, attempt: Attempt, sent: dict[str, str]) -> Attempt:
        services.refund_attempt(attempt=attempt, by=racer_of(request), now=timezone.now(), **sent)
        return visible_attempt(request, attempt.public_id)


class ReferencesView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "list_references",
        "Reference rows of an assignment",
        find=taught_assignment,
        answer=ReferenceSerializer,
        paged=True,
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[ReferenceRow]:
        return assignment.reference_rows.select_related("attempt")

    @operation(
        "add_reference",
        "Add a reference row",
        find=taught_assignment,
        body=ReferenceBody,
        answer=ReferenceSerializer,
        status=201,
    )
    def post(self, request: Request, assignment: Assignment, sent: dict[str, str]) -> ReferenceRow:
        model = _model(request, sent["model"])
        return services.add_reference(
            assignment=assignment, by=racer_of(request), label=sent["name"], model=model, now=timezone.now()
        )


class ReferenceView(PrivateView):
    token_scope = ORGANISE

    @operation("remove_reference", "Remove a reference row", find=shown_reference, answer="Removed.")
    def delete(self, request: Request, row: ReferenceRow) -> None:
        services.remove_reference(assignment=row.assignment, row=row, by=racer_of(request))
