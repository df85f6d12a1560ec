"""Groups of racers: list, create, show, change and delete them; members, join requests and the link to join."""

from typing import Any

from django.db.models import Q, QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.request import Request

from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView
from paddock.errors import UserFault

from ..models import GroupMember, RacerGroup
from ..request_racer import racer_of
from ..scopes import ORGANISE, RACE
from ..tokens.services import may_read_secrets
from . import services
from .selectors import can_lead, groups_visible_to, members_visible_to

LEADER, MEMBER, ASKED = "leader", "member", "asked"


class GroupSerializer(serializers.Serializer):
    """A group of racers."""

    slug = serializers.CharField()
    name = serializers.CharField()
    description = serializers.CharField(allow_blank=True)
    leader = serializers.CharField(source="leader.alias", default=None, allow_null=True)
    is_listed = serializers.BooleanField(help_text="Whether anybody sees the group and its members.")
    made_at = serializers.DateTimeField()
    code = serializers.SerializerMethodField(
        help_text="Of the link to join, for its leader; empty for others and for a token without the scope organise."
    )

    def get_code(self, group: RacerGroup) -> str:
        request = self.context["request"]
        return group.code if can_lead(request.user, group) and may_read_secrets(request) else ""


class GroupMemberSerializer(serializers.Serializer):
    """A member of a group, or a racer with a request to join."""

    racer = serializers.CharField(source="racer.alias")
    role = serializers.SerializerMethodField()
    asked_at = serializers.DateTimeField()
    confirmed_at = serializers.DateTimeField(allow_null=True)

    @extend_schema_field(serializers.ChoiceField([LEADER, MEMBER, ASKED]))
    def get_role(self, member: GroupMember) -> str:
        if member.racer_id == member.group.leader_id:
            return LEADER
        return ASKED if member.confirmed_at is None else MEMBER


class GroupBody(Body):
    """Name and description of a group."""

    name = serializers.CharField(max_length=64)
    description = serializers.CharField(max_length=500, required=False, allow_blank=True)


class JoinBody(Body):
    """The code of a link to join."""

    code = serializers.CharField(max_length=200, help_text="The code, or the whole link.")

    def validate_code(self, code: str) -> str:
        return code.rstrip("/").rsplit("/", 1)[-1]


class GroupRoleBody(Body):
    """What a racer becomes in a group."""

    role = serializers.ChoiceField(
        [MEMBER, LEADER], help_text="`member` confirms a racer who asked to join; `leader` makes a member the leader."
    )


class GroupsFilter(serializers.Serializer):
    """Which groups to list."""

    mine = serializers.BooleanField(required=False, help_text="Only groups that you lead, are in or asked to join.")


def visible_group(request: Any, slug: str) -> RacerGroup:
    """Raises Http404 for a group that the caller may not see."""
    return get_object_or_404(groups_visible_to(request.user), slug=slug)


def led_group(request: Request, slug: str) -> RacerGroup:
    """Raises as :func:`visible_group`, and UserFault("group_not_yours")."""
    group = visible_group(request, slug)
    if not can_lead(request.user, group):
        raise UserFault("group_not_yours")
    return group


def led_member(request: Request, slug: str, alias: str) -> GroupMember:
    """A member of a group that the caller leads. Raises as :func:`led_group`, Http404."""
    group = led_group(request, slug)
    return get_object_or_404(members_visible_to(request.user).filter(group=group), racer__alias=alias)


def own_membership(request: Request, slug: str) -> GroupMember:
    """The caller's place in a group. Raises Http404."""
    members = members_visible_to(request.user).filter(group=visible_group(request, slug))
    return get_object_or_404(members, racer=request.user)


class GroupsView(APIView):
    token_scope = ORGANISE

    @operation(
        "list_groups", "Listed groups and your own, by name", query=GroupsFilter, answer=GroupSerializer, paged=True
    )
    def get(self, request: Request, asked: dict[str, bool]) -> QuerySet[RacerGroup]:
        groups = groups_visible_to(request.user)
        if asked.get("mine"):
            racer = request.user.pk or 0  # None would match groups without a leader
            groups = groups.filter(Q(leader=racer) | Q(members__racer=racer)).distinct()
        return groups

    @operation(
        "create_group",
        "Create a group",
        body=GroupBody,
        answer=GroupSerializer,
        status=201,
        description="You lead it. Admins decide whether a group is listed.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> RacerGroup:
        return services.make_group(by=racer_of(request), now=timezone.now(), **sent)


class GroupView(APIView):
    token_scope = ORGANISE

    @operation("read_group", "A group", find=visible_group, answer=GroupSerializer)
    def get(self, request: Request, group: RacerGroup) -> RacerGroup:
        return group

    @operation(
        "change_group",
        "Change the name or the description of a group",
        find=led_group,
        body=GroupBody,
        partial=True,
        answer=GroupSerializer,
    )
    def patch(self, request: Request, group: RacerGroup, sent: dict[str, str]) -> RacerGroup:
        kept = {"name": group.name, "description": group.description}
        return services.change_group(group=group, by=racer_of(request), **kept | sent)

    @operation(
        "delete_group",
        "Delete a group",
        find=led_group,
        description="Groups that have races and groups of classes cannot be deleted.",
    )
    def delete(self, request: Request, group: RacerGroup) -> None:
        services.delete_group(group=group, by=racer_of(request))


class GroupLinkView(APIView):
    token_scope = ORGANISE

    @operation(
        "renew_group_link",
        "Replace the link to join a group",
        find=led_group,
        answer=GroupSerializer,
        description="The old code stops working.",
    )
    def post(self, request: Request, group: RacerGroup) -> RacerGroup:
        return services.new_group_link(group=group, by=racer_of(request))


class GroupJoinView(APIView):
    token_scope = RACE

    @operation(
        "join_group",
        "Ask to join the group of a link",
        body=JoinBody,
        answer=GroupMemberSerializer,
        description="Its leader confirms. A repeated request changes nothing.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> GroupMember:
        return services.ask_to_join(racer=racer_of(request), now=timezone.now(), **sent)


class GroupMembersView(APIView):
    @operation(
        "list_group_members",
        "Members of a group, the oldest first",
        find=visible_group,
        answer=GroupMemberSerializer,
        paged=True,
        description="Its leader also sees racers who have asked to join.",
    )
    def get(self, request: Request, group: RacerGroup) -> QuerySet[GroupMember]:
        return members_visible_to(request.user).filter(group=group).order_by("confirmed_at", "pk")


class GroupMemberView(APIView):
    token_scope = ORGANISE

    @operation(
        "change_group_member",
        "Confirm a racer who asked to join, or make a member the leader",
        find=led_member,
        body=GroupRoleBody,
        answer=GroupMemberSerializer,
    )
    def patch(self, request: Request, member: GroupMember, sent: dict[str, str]) -> GroupMember:
        by = racer_of(request)
        if sent["role"] == MEMBER:
            return services.confirm_member(member=member, by=by, now=timezone.now())
        services.hand_over_group(group=member.group, to=member.racer, by=by)
        return member

    @operation("remove_group_member", "Remove a member, or decline a request to join", find=led_member)
    def delete(self, request: Request, member: GroupMember) -> None:
        services.remove_member(member=member, by=racer_of(request))


class GroupMembershipView(APIView):
    token_scope = RACE

    @operation("leave_group", "Leave a group, or withdraw a request to join", find=own_membership)
    def delete(self, request: Request, member: GroupMember) -> None:
        services.remove_member(member=member, by=racer_of(request))
