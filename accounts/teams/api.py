"""Teams: list, found and show them; members, invitations and the link to join."""

from django.db.models import Count, QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from rest_framework import serializers
from rest_framework.request import Request

from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from paddock.errors import UserFault

from ..groups.api import JoinBody
from ..models import Team, TeamInvitation, TeamMember
from ..request_racer import racer_of
from ..scopes import RACE
from ..tokens.services import may_read_secrets
from . import services

CAPTAIN, MEMBER = "captain", "member"


class TeamSerializer(serializers.Serializer):
    """A team."""

    slug = serializers.CharField()
    name = serializers.CharField()
    captain = serializers.CharField(source="captain.alias", default=None, allow_null=True)
    members = serializers.SerializerMethodField(help_text="How many racers are in it.")
    made_at = serializers.DateTimeField()
    code = serializers.SerializerMethodField(
        help_text="Of the link to join, for its captain; empty for others and for a token without the scope race."
    )

    def get_members(self, team: Team) -> int:
        return team.member_count if hasattr(team, "member_count") else team.members.count()

    def get_code(self, team: Team) -> str:
        request = self.context["request"]
        return team.code if services.is_captain(request.user, team) and may_read_secrets(request, RACE) else ""


class TeamMemberSerializer(serializers.Serializer):
    """A racer in a team."""

    racer = serializers.CharField(source="racer.alias")
    role = serializers.SerializerMethodField()
    joined_at = serializers.DateTimeField()

    @extend_schema_field(serializers.ChoiceField([CAPTAIN, MEMBER]))
    def get_role(self, member: TeamMember) -> str:
        return CAPTAIN if member.racer_id == member.team.captain_id else MEMBER


class TeamInvitationSerializer(serializers.Serializer):
    """A racer with an open invitation to a team."""

    racer = serializers.CharField(source="racer.alias")
    team = serializers.CharField(source="team.slug")
    made_at = serializers.DateTimeField()


class TeamBody(Body):
    """The name of a team."""

    name = serializers.CharField(max_length=64, trim_whitespace=False)


class TeamInviteBody(Body):
    """The racer to invite."""

    racer = serializers.CharField(max_length=150, help_text="Their alias.")


class TeamRoleBody(Body):
    """What a member becomes."""

    role = serializers.ChoiceField([CAPTAIN])


class TeamsFilter(serializers.Serializer):
    """Which teams to list."""

    mine = serializers.BooleanField(required=False, help_text="Only the team that you are in.")
    invited = serializers.BooleanField(required=False, help_text="Only teams that invite you.")


def team_at(request: Request, slug: str) -> Team:
    """Everybody sees every team. Raises Http404."""
    return get_object_or_404(Team.objects.select_related("captain"), slug=slug)


def led_team(request: Request, slug: str) -> Team:
    """Raises as :func:`team_at`, and UserFault("team_captain_only")."""
    team = team_at(request, slug)
    if not services.is_captain(request.user, team):
        raise UserFault("team_captain_only")
    return team


def led_member(request: Request, slug: str, alias: str) -> TeamMember:
    """A member of a team whose captain the caller is. Raises as :func:`led_team`, Http404."""
    return get_object_or_404(led_team(request, slug).members.select_related("racer", "team"), racer__alias=alias)


def own_team(request: Request, slug: str) -> Team:
    """The caller's team. Raises Http404 for any other."""
    team = team_at(request, slug)
    if services.team_of(racer_of(request)) != team:
        raise Http404
    return team


def inviting_team(request: Request, slug: str) -> Team:
    """A team that the caller is in or invited to. Raises Http404, UserFault("team_not_asked")."""
    racer, team = racer_of(request), team_at(request, slug)
    if services.team_of(racer) != team and not team.invitations.filter(racer=racer).exists():
        raise UserFault("team_not_asked")
    return team


def visible_invitation(request: Request, slug: str, alias: str) -> TeamInvitation:
    """An invitation to the caller, or of the captain's team. Raises Http404."""
    visible = services.invitations_visible_to(request.user).filter(team=team_at(request, slug))
    return get_object_or_404(visible, racer__alias=alias)


class TeamsView(APIView):
    token_scope = RACE

    @operation("list_teams", "All teams, by name", query=TeamsFilter, answer=TeamSerializer, paged=True)
    def get(self, request: Request, asked: dict[str, bool]) -> QuerySet[Team]:
        teams = Team.objects.select_related("captain").order_by("name", "pk")
        if asked.get("mine"):
            teams = teams.filter(pk__in=TeamMember.objects.filter(racer=request.user.pk).values("team"))
        if asked.get("invited"):
            teams = teams.filter(pk__in=TeamInvitation.objects.filter(racer=request.user.pk).values("team"))
        return teams.annotate(member_count=Count("members"))

    @operation(
        "found_team",
        "Found a team",
        body=TeamBody,
        answer=TeamSerializer,
        status=201,
        description="You are its captain and first member.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> Team:
        return services.found_team(by=racer_of(request), now=timezone.now(), **sent)


class TeamView(APIView):
    @operation("read_team", "A team", find=team_at, answer=TeamSerializer)
    def get(self, request: Request, team: Team) -> Team:
        return team


class TeamLinkView(APIView):
    token_scope = RACE

    @operation(
        "renew_team_link",
        "Replace the link to join a team",
        find=led_team,
        answer=TeamSerializer,
        description="The old code stops working.",
    )
    def post(self, request: Request, team: Team) -> Team:
        return services.new_team_link(team=team, by=racer_of(request))


class TeamJoinView(APIView):
    token_scope = RACE

    @operation(
        "join_team",
        "Join the team of a link",
        body=JoinBody,
        answer=TeamSerializer,
        description="A repeated request changes nothing.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> Team:
        return services.join_by_link(racer=racer_of(request), now=timezone.now(), **sent)


class TeamMembersView(APIView):
    @operation(
        "list_team_members",
        "Members of a team, the oldest first",
        find=team_at,
        answer=TeamMemberSerializer,
        paged=True,
    )
    def get(self, request: Request, team: Team) -> QuerySet[TeamMember]:
        return team.members.select_related("racer", "team").order_by("joined_at", "pk")


class TeamMemberView(APIView):
    token_scope = RACE

    @operation(
        "change_team_member",
        "Make a member the captain",
        find=led_member,
        body=TeamRoleBody,
        answer=TeamMemberSerializer,
    )
    def patch(self, request: Request, member: TeamMember, sent: dict[str, str]) -> TeamMember:
        services.hand_over_team(team=member.team, to=member.racer, by=racer_of(request))
        return member

    @operation("remove_team_member", "Remove a member from a team", find=led_member)
    def delete(self, request: Request, member: TeamMember) -> None:
        services.remove_from_team(team=member.team, racer=member.racer, by=racer_of(request))


class TeamMembershipView(APIView):
    token_scope = RACE

    @operation("accept_team_invitation", "Join a team that invites you", find=inviting_team, answer=TeamSerializer)
    def post(self, request: Request, team: Team) -> Team:
        racer = racer_of(request)
        invitation = team.invitations.filter(racer=racer).first()
        if invitation is None:
            return team
        return services.accept_team(invitation=invitation, racer=racer, now=timezone.now())

    @operation(
        "leave_team",
        "Leave your team",
        find=own_team,
        description="A captain hands over first. A team without members is closed.",
    )
    def delete(self, request: Request, team: Team) -> None:
        services.leave_team(racer=racer_of(request))


class TeamInvitationsView(PrivateView):
    token_scope = RACE

    @operation(
        "list_team_invitations",
        "Open invitations of a team",
        find=team_at,
        answer=TeamInvitationSerializer,
        paged=True,
        description="All of them for its captain, your own otherwise.",
    )
    def get(self, request: Request, team: Team) -> QuerySet[TeamInvitation]:
        return services.invitations_visible_to(request.user).filter(team=team).order_by("pk")

    @operation(
        "invite_to_team",
        "Invite a racer to a team",
        find=led_team,
        body=TeamInviteBody,
        answer=TeamInvitationSerializer,
        status=201,
        description="A repeated invitation changes nothing.",
    )
    def post(self, request: Request, team: Team, sent: dict[str, str]) -> TeamInvitation:
        return services.invite_to_team(team=team, alias=sent["racer"], by=racer_of(request), now=timezone.now())


class TeamInvitationView(APIView):
    token_scope = RACE

    @operation(
        "remove_team_invitation",
        "Decline an invitation of yours, or withdraw one as captain",
        find=visible_invitation,
    )
    def delete(self, request: Request, invitation: TeamInvitation) -> None:
        services.decline_team(invitation=invitation, by=racer_of(request))
