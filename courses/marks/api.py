"""Marks of an assignment, and regrades."""

from typing import Any

from django.db.models import QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.request import Request

from accounts.models import Racer
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import PrivateView

from ..assignments.api import taught_assignment, visible_assignment
from ..models import Assignment, Mark, Regrade
from . import services
from .selectors import marks_visible_to


class MarkSerializer(serializers.Serializer):
    """The mark of a student."""

    racer = serializers.CharField(source="racer.alias")
    attempt = serializers.CharField(
        source="attempt.public_id", default=None, allow_null=True, help_text="The one that counts."
    )
    points = serializers.DecimalField(max_digits=8, decimal_places=2)
    before_late = serializers.DecimalField(max_digits=8, decimal_places=2, help_text="Before points off for lateness.")
    late_days = serializers.IntegerField()
    parts = serializers.ListField(
        child=serializers.DictField(), help_text="By part: number, points, passed (null: not decided yet), why, tracks."
    )
    is_complete = serializers.BooleanField(help_text="No run waits, and no hidden track is to come.")
    rules_version = serializers.IntegerField()
    computed_at = serializers.DateTimeField()


class RegradeRowSerializer(serializers.Serializer):
    """A mark that differs."""

    racer = serializers.CharField(allow_null=True)
    old = serializers.CharField()
    new = serializers.CharField()


class RegradeSerializer(serializers.Serializer):
    """Marks by changed rules, beside those that stand."""

    number = serializers.IntegerField(source="pk")
    reason = serializers.CharField()
    rules_version = serializers.IntegerField()
    asked_by = serializers.CharField(source="asked_by.alias", default=None, allow_null=True)
    asked_at = serializers.DateTimeField()
    applied_at = serializers.DateTimeField(allow_null=True)
    rows = serializers.SerializerMethodField()

    @extend_schema_field(RegradeRowSerializer(many=True))
    def get_rows(self, regrade: Regrade) -> Any:
        aliases = dict(Racer.objects.filter(pk__in=[row["racer"] for row in regrade.rows]).values_list("pk", "alias"))
        rows = [{**row, "racer": aliases.get(row["racer"])} for row in regrade.rows]
        return RegradeRowSerializer(rows, many=True).data


class RegradeBody(Body):
    """Why marks are to change."""

    reason = serializers.CharField(max_length=200)


def proposed_regrade(request: Any, public_id: str, number: int) -> Regrade:
    """Raises Http404, UserFault("assignment_not_yours")."""
    found = taught_assignment(request, public_id).regrades.select_related("assignment__group", "asked_by")
    return get_object_or_404(found, pk=number)


class MarksView(PrivateView):
    @operation(
        "list_marks",
        "Marks of an assignment",
        find=visible_assignment,
        answer=MarkSerializer,
        paged=True,
        description="Your own; for teachers those of all students.",
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[Mark]:
        return marks_visible_to(request.user).filter(assignment=assignment)


class RegradesView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "list_regrades",
        "Regrades of an assignment, newest first",
        find=taught_assignment,
        answer=RegradeSerializer,
        paged=True,
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[Regrade]:
        return assignment.regrades.select_related("asked_by")

    @operation(
        "propose_regrade",
        "Compute marks by the changed rules",
        find=taught_assignment,
        body=RegradeBody,
        answer=RegradeSerializer,
        status=201,
        description="Changes no mark.",
    )
    def post(self, request: Request, assignment: Assignment, sent: dict[str, str]) -> Regrade:
        return services.propose_regrade(assignment=assignment, by=racer_of(request), now=timezone.now(), **sent)


class RegradeApplicationView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "apply_regrade",
        "Write the marks of a regrade",
        find=proposed_regrade,
        answer=RegradeSerializer,
        description="As they were shown: it is refused once rules or results have changed since.",
    )
    def post(self, request: Request, regrade: Regrade) -> Regrade:
        return services.apply_regrade(
            assignment=regrade.assignment, regrade=regrade, by=racer_of(request), now=timezone.now()
        )
