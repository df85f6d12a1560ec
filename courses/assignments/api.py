"""Assignments: list, create, read, change, publish and delete them; extensions and submission groups."""

from functools import partial
from typing import Any

from django.db.models import Prefetch, QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.request import Request

from accounts.models import Racer
from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body
from core.api.fields import ZonedDateTimeField
from core.api.operations import operation
from core.api.views import PrivateView
from paddock.errors import UserFault
from tracks.api import TrackField
from tracks.models import Track

from ..grading.members import groups_taught_by, students_of
from ..marking.pass_rules import PASS_RULES
from ..models import Assignment, AssignmentPart, Counts, Extension, PartTrack, Shows, SubmissionGroup, TrackKind
from . import services
from .parts import MOST_PARTS, MOST_TRACKS
from .selectors import assignments_visible_to, can_teach
from .wording import pass_rule_sentence

PointsField = partial(serializers.DecimalField, max_digits=6, decimal_places=2)
MOST_MEMBERS = 20


class PartTrackSerializer(serializers.Serializer):
    """A track of a part."""

    track = serializers.CharField(source="track.slug")
    kind = serializers.ChoiceField(TrackKind.choices)


class PartSerializer(serializers.Serializer):
    """A part of an assignment, which is graded apart."""

    number = serializers.IntegerField()
    title = serializers.CharField()
    points = PointsField()
    pass_rule = serializers.ChoiceField([*PASS_RULES])
    pass_params = serializers.DictField()
    sentence = serializers.SerializerMethodField(help_text="The rule for passing in words.")
    rules = serializers.DictField(help_text="The race rules that are driven.")
    tracks = serializers.SerializerMethodField(
        help_text="Those that the caller may know: candidates are for teachers, drawn tracks for students too."
    )
    hidden_tracks = serializers.IntegerField(help_text="How many of the candidates are drawn at the deadline.")

    def get_sentence(self, part: AssignmentPart) -> str:
        return pass_rule_sentence(part.pass_rule, part.pass_params)

    @extend_schema_field(PartTrackSerializer(many=True))
    def get_tracks(self, part: AssignmentPart) -> Any:
        known = [one for one in part.tracks.all() if self.context["teaches"] or one.kind != TrackKind.CANDIDATE]
        return PartTrackSerializer(known, many=True).data


class AssignmentSerializer(serializers.Serializer):
    """An assignment."""

    public_id = serializers.CharField()
    group = serializers.CharField(source="group.slug")
    title = serializers.CharField()
    instructions = serializers.CharField(allow_blank=True)
    time_zone = serializers.CharField()
    opens_at = serializers.DateTimeField()
    due_at = serializers.DateTimeField(help_text="What is accepted at this very moment is in time.")
    last_at = serializers.DateTimeField(allow_null=True, help_text="Until when late attempts are accepted; null: none.")
    late_points_a_day = PointsField()
    attempts_a_day = serializers.IntegerField(allow_null=True, help_text="On a calendar day of the time zone.")
    attempts_in_all = serializers.IntegerField(allow_null=True)
    counts = serializers.ChoiceField(Counts.choices)
    first_k = serializers.IntegerField(allow_null=True)
    shows = serializers.ChoiceField(Shows.choices)
    published_at = serializers.DateTimeField(allow_null=True)
    drawn_at = serializers.DateTimeField(allow_null=True)
    final_at = serializers.DateTimeField(allow_null=True, help_text="Since when all marks are complete.")
    awaits_regrade = serializers.BooleanField(help_text="Whether rules have changed that no mark is computed by yet.")
    parts = serializers.SerializerMethodField()

    @extend_schema_field(PartSerializer(many=True))
    def get_parts(self, assignment: Assignment) -> Any:
        teaches = can_teach(self.context["request"].user, assignment)
        return PartSerializer(assignment.parts.all(), many=True, context={"teaches": teaches}).data


class PartTrackBody(Body):
    """A track of a part."""

    track = TrackField()
    kind = serializers.ChoiceField([TrackKind.SHOWN, TrackKind.CANDIDATE], default=TrackKind.SHOWN)


class PartBody(Body):
    """A part. Values that are left out of `pass_params` and `rules` have their defaults."""

    title = serializers.CharField(max_length=80)
    points = PointsField(min_value=0)
    pass_rule = serializers.ChoiceField([*PASS_RULES])
    pass_params = serializers.DictField(required=False)
    rules = serializers.DictField(required=False)
    tracks = serializers.ListField(child=PartTrackBody(), min_length=1, max_length=MOST_TRACKS)
    hidden_tracks = serializers.IntegerField(required=False, min_value=0, max_value=5)

    def validate_tracks(self, tracks: list[dict[str, Any]]) -> list[tuple[Track, str]]:
        return [(one["track"], one["kind"]) for one in tracks]


class AssignmentChangeBody(Body):
    """The fields to change; `parts` replaces all."""

    title = serializers.CharField(max_length=80, required=False)
    instructions = serializers.CharField(max_length=10_000, required=False, allow_blank=True)
    time_zone = serializers.CharField(max_length=64, required=False, help_text="Such as `Europe/Berlin`.")
    opens_at = ZonedDateTimeField(required=False)
    due_at = ZonedDateTimeField(required=False)
    last_at = ZonedDateTimeField(required=False, allow_null=True)
    late_points_a_day = PointsField(min_value=0, required=False)
    attempts_a_day = serializers.IntegerField(min_value=1, max_value=1000, required=False, allow_null=True)
    attempts_in_all = serializers.IntegerField(min_value=1, max_value=1000, required=False, allow_null=True)
    counts = serializers.ChoiceField(Counts.choices, required=False)
    first_k = serializers.IntegerField(min_value=1, max_value=1000, required=False, allow_null=True)
    shows = serializers.ChoiceField(Shows.choices, required=False)
    parts = serializers.ListField(child=PartBody(), required=False, max_length=MOST_PARTS)


class AssignmentBody(AssignmentChangeBody):
    """A new assignment."""

    title = serializers.CharField(max_length=80)
    opens_at = ZonedDateTimeField()
    due_at = ZonedDateTimeField()
    group = serializers.CharField(max_length=64, help_text="The address of a group that you teach.")


class ExtensionSerializer(serializers.Serializer):
    """A later deadline of a student."""

    racer = serializers.CharField(source="racer.alias")
    due_at = serializers.DateTimeField()
    last_at = serializers.DateTimeField(allow_null=True)
    reason = serializers.CharField(allow_blank=True)
    granted_by = serializers.CharField(
        source="granted_by.alias", default=None, allow_null=True, help_text="null: the site, after its own fault."
    )
    granted_at = serializers.DateTimeField()


class ExtensionBody(Body):
    """A later deadline of a student, in place of one given before."""

    racer = serializers.CharField(max_length=150)
    due_at = ZonedDateTimeField()
    last_at = ZonedDateTimeField(required=False, allow_null=True)
    reason = serializers.CharField(max_length=200, required=False, allow_blank=True)


class SubmissionGroupSerializer(serializers.Serializer):
    """Students who submit together."""

    number = serializers.IntegerField(source="pk")
    name = serializers.CharField()
    racers = serializers.SerializerMethodField()

    def get_racers(self, group: SubmissionGroup) -> list[str]:
        return [member.racer.alias for member in group.members.all()]


class SubmissionGroupBody(Body):
    """Students who submit together from now on."""

    name = serializers.CharField(max_length=40)
    racers = serializers.ListField(child=serializers.CharField(max_length=150), min_length=1, max_length=MOST_MEMBERS)


def visible_assignment(request: Any, public_id: str) -> Assignment:
    """Raises Http404 for an assignment that the caller may not see."""
    return get_object_or_404(_with_parts(assignments_visible_to(request.user)), public_id=public_id)


def taught_assignment(request: Any, public_id: str) -> Assignment:
    """Raises as :func:`visible_assignment`, and UserFault("assignment_not_yours") for students."""
    assignment = visible_assignment(request, public_id)
    if not can_teach(request.user, assignment):
        raise UserFault("assignment_not_yours")
    return assignment


def given_extension(request: Any, public_id: str, alias: str) -> Extension:
    """Raises as :func:`taught_assignment`, Http404."""
    found = taught_assignment(request, public_id).extensions.select_related("racer", "assignment__group")
    return get_object_or_404(found, racer__alias=alias)


def made_submission_group(request: Any, public_id: str, number: int) -> SubmissionGroup:
    """Raises as :func:`taught_assignment`, Http404."""
    found = taught_assignment(request, public_id).submission_groups.select_related("assignment__group")
    return get_object_or_404(found, pk=number)


def _student(assignment: Assignment, alias: str) -> Racer:
    student = students_of(assignment.group_id).filter(alias=alias).first()
    if student is None:
        raise UserFault("assignment_student_unknown")
    return student


def _with_parts(assignments: QuerySet[Assignment]) -> QuerySet[Assignment]:
    tracks = PartTrack.objects.select_related("track").defer("track__npy")
    return assignments.prefetch_related(Prefetch("parts__tracks", tracks))


def _again(request: Request, assignment: Assignment) -> Assignment:
    return visible_assignment(request, assignment.public_id)


class AssignmentView(PrivateView):
    token_scope = ORGANISE

    @operation("read_assignment", "An assignment", find=visible_assignment, answer=AssignmentSerializer)
    def get(self, request: Request, assignment: Assignment) -> Assignment:
        return assignment

    @operation(
        "change_assignment",
        "Change an assignment",
        find=taught_assignment,
        body=AssignmentChangeBody,
        answer=AssignmentSerializer,
        description="After the first attempt, tracks and race rules stay. Marks that would change wait for a regrade.",
    )
    def patch(self, request: Request, assignment: Assignment, sent: dict[str, object]) -> Assignment:
        services.change_assignment(assignment=assignment, by=racer_of(request), now=timezone.now(), **sent)
        return _again(request, assignment)

    @operation(
        "delete_assignment",
        "Delete an assignment with its attempts, runs and marks",
        find=taught_assignment,
        answer="Deleted.",
    )
    def delete(self, request: Request, assignment: Assignment) -> None:
        services.delete_assignment(assignment=assignment, by=racer_of(request))


class AssignmentsView(PrivateView):
    token_scope = ORGANISE

    @operation("list_assignments", "Assignments that you see, by deadline", answer=AssignmentSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Assignment]:
        return _with_parts(assignments_visible_to(request.user))

    @operation(
        "create_assignment",
        "Create an assignment",
        body=AssignmentBody,
        answer=AssignmentSerializer,
        status=201,
        description="Students do not see it before it is published.",
    )
    def post(self, request: Request, sent: dict[str, object]) -> Assignment:
        by = racer_of(request)
        group = groups_taught_by(by).filter(slug=str(sent.pop("group"))).first()
        if group is None:  # also one that does not exist: groups are not public
            raise UserFault("assignment_not_yours")
        return _again(request, services.make_assignment(group=group, by=by, now=timezone.now(), **sent))


class PublicationView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "publish_assignment",
        "Publish an assignment",
        find=taught_assignment,
        answer=AssignmentSerializer,
        description="Shows it to the students. A repeated request changes nothing.",
    )
    def post(self, request: Request, assignment: Assignment) -> Assignment:
        services.publish_assignment(assignment=assignment, by=racer_of(request), now=timezone.now())
        return _again(request, assignment)


class ExtensionsView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "list_extensions",
        "Extensions of an assignment",
        find=taught_assignment,
        answer=ExtensionSerializer,
        paged=True,
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[Extension]:
        return assignment.extensions.select_related("racer", "granted_by")

    @operation(
        "give_extension",
        "Give a student a later deadline",
        find=taught_assignment,
        body=ExtensionBody,
        answer=ExtensionSerializer,
        status=201,
    )
    def post(self, request: Request, assignment: Assignment, sent: dict[str, Any]) -> Extension:
        values = {"last_at": None, "reason": "", **sent}
        values["racer"] = _student(assignment, values["racer"])
        return services.extend(assignment=assignment, by=racer_of(request), now=timezone.now(), **values)


class ExtensionView(PrivateView):
    token_scope = ORGANISE

    @operation("end_extension", "Take an extension back", find=given_extension, answer="Taken back.")
    def delete(self, request: Request, given: Extension) -> None:
        services.end_extension(assignment=given.assignment, racer=given.racer, by=racer_of(request), now=timezone.now())


class SubmissionGroupsView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "list_submission_groups",
        "Students who submit together, by name",
        find=taught_assignment,
        answer=SubmissionGroupSerializer,
        paged=True,
    )
    def get(self, request: Request, assignment: Assignment) -> QuerySet[SubmissionGroup]:
        return assignment.submission_groups.prefetch_related("members__racer")

    @operation(
        "create_submission_group",
        "Let students submit together",
        find=taught_assignment,
        body=SubmissionGroupBody,
        answer=SubmissionGroupSerializer,
        status=201,
    )
    def post(self, request: Request, assignment: Assignment, sent: dict[str, Any]) -> SubmissionGroup:
        racers = [_student(assignment, alias) for alias in sent["racers"]]
        return services.make_submission_group(
            assignment=assignment, by=racer_of(request), name=sent["name"], racers=racers, now=timezone.now()
        )


class SubmissionGroupView(PrivateView):
    token_scope = ORGANISE

    @operation(
        "delete_submission_group",
        "Let students submit alone again",
        find=made_submission_group,
        answer="Deleted.",
    )
    def delete(self, request: Request, group: SubmissionGroup) -> None:
        services.delete_submission_group(group=group, by=racer_of(request), now=timezone.now())
