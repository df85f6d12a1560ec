"""Joining a race, submitting models and withdrawing."""

from typing import Any

from django.utils import timezone
from rest_framework import serializers
from rest_framework.fields import empty
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE, RACE
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from evaluation.garage.api import ModelSummarySerializer
from evaluation.models import State
from evaluation.selectors import models_of
from paddock.errors import UserFault

from ...entries.selectors.lists import SubmissionRow, submissions_of
from ...entries.services.entries import accept_invitation, enter_race, remove_entry, restore_entry, withdraw
from ...entries.services.submissions import submit_model
from ...models import Entry, Race
from ...web.api import invitation, organised_entry, own_entry, visible_race
from ...web.serializers import EntrySerializer


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
    """The terms accepted by joining."""

    terms = serializers.IntegerField(
        required=False, min_value=1, help_text="The version of the race's terms that you accept (`terms_version`)."
    )

    def run_validation(self, data: Any = empty) -> Any:
        return super().run_validation(data or {})  # null and [] are no fields


class SubmitSerializer(JoinSerializer):
    """Which car."""

    model = serializers.CharField(max_length=64, help_text="The public_id of one of your models.")


class RemovalSerializer(Body):
    """Why."""

    reason = serializers.CharField(required=False, allow_blank=True, max_length=255, help_text="The racer reads it.")


class EntryView(PrivateView):
    token_scope = RACE

    @operation("read_entry", "My entry", find=own_entry, answer=EntrySerializer)
    def get(self, request: Request, entry: Entry) -> Entry:
        return entry

    @operation(
        "enter_race",
        "Enter a race",
        find=visible_race,
        body=JoinSerializer,
        answer=EntrySerializer,
        description="Entering twice changes nothing; entering after a withdrawal restores all results.",
    )
    def post(self, request: Request, race: Race, sent: dict) -> Entry:
        return enter_race(race=race, racer=racer_of(request), now=timezone.now(), **sent)

    @operation(
        "withdraw",
        "Withdraw from a race",
        find=own_entry,
        answer="Off the board; entering again brings all results back.",
    )
    def delete(self, request: Request, entry: Entry) -> None:
        withdraw(entry=entry, now=timezone.now())


class SubmissionsView(PrivateView):
    token_scope = RACE

    @operation(
        "list_submissions",
        "My submissions to a race, the newest first",
        find=own_entry,
        answer=SubmissionSerializer,
        paged=True,
    )
    def get(self, request: Request, entry: Entry) -> list[SubmissionRow]:
        return submissions_of(entry)

    @operation(
        "submit_model",
        "Submit a car to a race",
        find=visible_race,
        body=SubmitSerializer,
        answer=SubmissionSerializer,
        status=201,
        description="Enters you too if you may enter. The same car gives the same result, so it is refused a second "
        "time, with the code car_already_submitted and the id of the evaluation that stands.",
    )
    def post(self, request: Request, race: Race, sent: dict) -> SubmissionRow:
        model = models_of(request.user).filter(public_id=sent.pop("model")).first()
        if model is None:
            raise UserFault("model_not_yours")
        submission = submit_model(race=race, racer=racer_of(request), model=model, now=timezone.now(), **sent)
        return SubmissionRow(submission, standing=None, is_best=False)


class InvitationView(APIView):
    token_scope = RACE

    @operation(
        "accept_invitation",
        "Join the race that an invitation belongs to",
        find=invitation,
        body=JoinSerializer,
        answer=EntrySerializer,
    )
    def post(self, request: Request, token: str, sent: dict) -> Entry:
        return accept_invitation(token=token, racer=racer_of(request), now=timezone.now(), **sent)


class RemovalView(APIView):
    token_scope = ORGANISE

    @operation(
        "remove_entry",
        "Remove a racer from a race that you organise",
        find=organised_entry,
        body=RemovalSerializer,
        answer=EntrySerializer,
    )
    def post(self, request: Request, entry: Entry, sent: dict) -> Entry:
        return remove_entry(entry=entry, by=racer_of(request), reason=sent.get("reason", ""), now=timezone.now())

    @operation("restore_entry", "Restore a removed racer", find=organised_entry, answer=EntrySerializer)
    def delete(self, request: Request, entry: Entry) -> Entry:
        return restore_entry(entry=entry, by=racer_of(request))
