"""Getting into a race, sending cars to it, getting out again."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiResponse, extend_schema, extend_schema_field, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE, RACE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from evaluation.models import State
from evaluation.selectors import models_of
from paddock.errors import UserFault

from .. import services
from ..models import Entry
from ..selectors import SubmissionRow, rank_of, submissions_of
from .evaluations import ModelSummarySerializer, NamedSerializer
from .lookup import organised_race, own_entry, visible_race


class EntrySerializer(serializers.Serializer):
    """A racer in a race, with the standing of the best submission. Times in milliseconds."""

    race = NamedSerializer()
    racer = serializers.CharField(source="racer.alias")
    entered_at = serializers.DateTimeField()
    withdrawn_at = serializers.DateTimeField(allow_null=True)
    removed_at = serializers.DateTimeField(allow_null=True)
    removal_reason = serializers.CharField(allow_blank=True)
    accepted_terms = serializers.SerializerMethodField(
        help_text="The newest version of the race's terms that was accepted, and when; null for none."
    )
    submission_count = serializers.IntegerField(help_text="Those that count.")
    submissions_left = serializers.SerializerMethodField(help_text="null: any number.")
    rank = serializers.SerializerMethodField()
    classified = serializers.BooleanField()
    score_ms = serializers.IntegerField(allow_null=True, help_text="What the race ranks by.")
    average_ms = serializers.IntegerField(allow_null=True)
    best_lap_ms = serializers.IntegerField(allow_null=True)
    total_ms = serializers.IntegerField(allow_null=True)
    complete_laps = serializers.IntegerField()
    off_tracks = serializers.IntegerField()
    resets = serializers.IntegerField()
    evaluation = serializers.CharField(
        source="best.evaluation.public_id", default=None, allow_null=True, help_text="Of the best submission."
    )

    @extend_schema_field(
        {
            "type": "object",
            "nullable": True,
            "properties": {"version": {"type": "integer"}, "at": {"type": "string", "format": "date-time"}},
            "required": ["version", "at"],
        }
    )
    def get_accepted_terms(self, entry: Entry) -> dict[str, object] | None:
        accepted = entry.accepted_terms.select_related("terms").order_by("-terms__version").first()
        return {"version": accepted.terms.version, "at": accepted.accepted_at} if accepted else None

    def get_submissions_left(self, entry: Entry) -> int | None:
        limit = entry.race.max_submissions
        return None if limit is None else max(0, limit - entry.submission_count)

    def get_rank(self, entry: Entry) -> int | None:
        return rank_of(entry)


class SubmissionSerializer(serializers.Serializer):
    """One car sent to a race."""

    number = serializers.IntegerField(source="submission.number")
    submitted_at = serializers.DateTimeField(source="submission.submitted_at")
    model = ModelSummarySerializer(source="submission.evaluation.model")
    evaluation = serializers.CharField(source="submission.evaluation.public_id")
    state = serializers.ChoiceField(State.choices, source="submission.evaluation.state")
    reason_code = serializers.CharField(
        source="submission.evaluation.reason_code", allow_blank=True, help_text="When it failed or was stopped."
    )
    is_void = serializers.BooleanField(
        source="submission.is_void", help_text="Ended without a result. The car can be submitted again."
    )
    refunded = serializers.BooleanField(
        source="submission.refunded", help_text="Does not count against the submission limit."
    )
    is_best = serializers.BooleanField(help_text="The one that stands on the board.")
    classified = serializers.BooleanField(source="standing.classified", default=None, allow_null=True)
    score_ms = serializers.IntegerField(source="standing.score_ms", default=None, allow_null=True)
    average_ms = serializers.IntegerField(source="standing.average_ms", default=None, allow_null=True)
    best_lap_ms = serializers.IntegerField(source="standing.best_lap_ms", default=None, allow_null=True)
    total_ms = serializers.IntegerField(source="standing.total_ms", default=None, allow_null=True)
    complete_laps = serializers.IntegerField(source="standing.complete_laps", default=None, allow_null=True)
    off_tracks = serializers.IntegerField(source="standing.off_tracks", default=None, allow_null=True)
    resets = serializers.IntegerField(source="standing.resets", default=None, allow_null=True)


class JoinSerializer(Body):
    """What is accepted with joining."""

    terms = serializers.IntegerField(
        required=False, min_value=1, help_text="The version of the race's terms that you accept (`terms_version`)."
    )


class SubmitSerializer(JoinSerializer):
    """Which car."""

    model = serializers.CharField(max_length=64, help_text="The public_id of one of your models.")


class RemovalSerializer(Body):
    """Why."""

    reason = serializers.CharField(required=False, allow_blank=True, max_length=255, help_text="The racer reads it.")


class EntryView(APIView):
    """My entry in a race."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="read_entry", summary="My entry", responses=EntrySerializer, tags=["races"])
    def get(self, request: Request, slug: str) -> Response:
        return Response(EntrySerializer(own_entry(request, slug)).data)

    @extend_schema(
        operation_id="enter_race",
        summary="Enter a race",
        description="Who is in stays in; who has withdrawn is back with all they drove.",
        request=JoinSerializer,
        responses=EntrySerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        sent, race = read_as(JoinSerializer, request.data or {}), visible_race(request, slug)
        entry = services.enter_race(race=race, racer=racer_of(request), now=timezone.now(), **sent)
        return Response(EntrySerializer(entry).data)

    @extend_schema(
        operation_id="withdraw",
        summary="Withdraw from a race",
        request=None,
        responses={204: OpenApiResponse(description="Off the board; entering again brings all results back.")},
        tags=["races"],
    )
    def delete(self, request: Request, slug: str) -> Response:
        refuse_fields(request)
        services.withdraw(entry=own_entry(request, slug), now=timezone.now())
        return Response(status=status.HTTP_204_NO_CONTENT)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_submissions",
        summary="My submissions to a race, the newest first",
        responses=SubmissionSerializer,
        tags=["races"],
    )
)
class SubmissionsView(generics.ListAPIView):
    """My submissions to a race: list them, send a car."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]
    serializer_class = SubmissionSerializer

    def get_queryset(self) -> list[SubmissionRow]:  # type: ignore[override]  # pages are cut from a list as well
        if getattr(self, "swagger_fake_view", False):  # the schema is being written
            return []
        return submissions_of(own_entry(self.request, self.kwargs["slug"]))

    @extend_schema(
        operation_id="submit_model",
        summary="Send a car to a race",
        description="Enters you too where you may be. The same car gives the same result, so it is refused a second "
        "time, with the code car_already_submitted and the id of the evaluation that stands.",
        request=SubmitSerializer,
        responses={201: SubmissionSerializer},
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = visible_race(request, slug)
        sent = read_as(SubmitSerializer, request.data)
        model = models_of(request.user).filter(public_id=sent["model"]).first()
        if model is None:
            raise UserFault("model_not_yours")
        submission = services.submit_model(
            race=race, racer=racer_of(request), model=model, now=timezone.now(), terms=sent.get("terms")
        )
        row = SubmissionRow(submission, standing=None, is_best=False)
        return Response(SubmissionSerializer(row).data, status=status.HTTP_201_CREATED)


class InvitationView(APIView):
    """Joining a race by its invitation."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="accept_invitation",
        summary="Join the race that an invitation belongs to",
        request=JoinSerializer,
        responses=EntrySerializer,
        tags=["races"],
    )
    def post(self, request: Request, token: str) -> Response:
        sent = read_as(JoinSerializer, request.data or {})
        entry = services.accept_invitation(token=token, racer=racer_of(request), now=timezone.now(), **sent)
        return Response(EntrySerializer(entry).data)


class RemovalView(APIView):
    """Taking somebody out of a race for good."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="remove_entry",
        summary="Remove a racer from a race that you organise",
        request=RemovalSerializer,
        responses=EntrySerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str, alias: str) -> Response:
        entry = self._entry(request, slug, alias)
        reason = read_as(RemovalSerializer, request.data).get("reason", "")
        entry = services.remove_entry(entry=entry, by=racer_of(request), reason=reason, now=timezone.now())
        return Response(EntrySerializer(entry).data)

    @extend_schema(
        operation_id="restore_entry",
        summary="Put a removed racer back on the board",
        request=None,
        responses={200: EntrySerializer},
        tags=["races"],
    )
    def delete(self, request: Request, slug: str, alias: str) -> Response:
        refuse_fields(request)
        entry = services.restore_entry(entry=self._entry(request, slug, alias), by=racer_of(request))
        return Response(EntrySerializer(entry).data)

    def _entry(self, request: Request, slug: str, alias: str) -> Entry:
        entries = Entry.objects.select_related("race", "racer", "best__evaluation")
        return get_object_or_404(entries, race=organised_race(request, slug), racer__alias__iexact=alias)
