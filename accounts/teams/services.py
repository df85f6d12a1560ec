"""Founding teams, joining, leaving, and what their captains do."""

from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet
from django.utils.crypto import get_random_string
from django.utils.text import slugify
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.locks import hold
from core.events import record
from core.validators import normalized
from paddock.errors import UserFault

from ..events import TEAM_INVITED
from ..models import Racer, Team, TeamInvitation, TeamMember
from ..models.access import new_code
from ..models.team import team_key

MEMBERS = 50
INVITATIONS = 50  # that a team may have waiting
RESERVED = frozenset({"new", "join", "leave"})


def is_captain(racer: object, team: Team) -> bool:
    """Whether the racer invites to the team and removes from it: its captain and admins."""
    return isinstance(racer, Racer) and (racer.is_staff or racer.pk == team.captain_id)


def invitations_visible_to(viewer: object) -> QuerySet[TeamInvitation]:
    """Invitations that the viewer can see: their own, those of the team that they lead, and admins all."""
    found = TeamInvitation.objects.select_related("team", "racer")
    if not isinstance(viewer, Racer):
        return found.none()
    return found if viewer.is_staff else found.filter(racer=viewer) | found.filter(team__captain=viewer)


def team_of(racer: Racer) -> Team | None:
    member = TeamMember.objects.filter(racer=racer).select_related("team").first()
    return None if member is None else member.team


@transaction.atomic
def found_team(*, by: Racer, name: str, now: datetime) -> Team:
    """A team with ``by`` as its captain and first member. Raises UserFault("team_in_one_already" | "team_name_taken")
    and django's ValidationError by field."""
    hold(by)
    _require_free(by)
    name = " ".join(filter(None, normalized(name).split(" ")))
    if Team.objects.filter(key=team_key(name)).exists():
        raise UserFault("team_name_taken")
    team = Team(name=name, key=team_key(name), captain=by, made_at=now, slug=_free_slug(name))
    team.full_clean(exclude={"key"})
    team.save()
    _join(team, by, now)
    return team


@audited("team.invited", _("Racer invited to a team"), unless="captain")
@transaction.atomic
def invite_to_team(*, team: Team, alias: str, by: Racer, now: datetime) -> TeamInvitation:
    """Invite a racer to a team; an open invitation stays as it is. Raises UserFault("team_captain_only" |
    "team_no_such_racer" | "team_too_many_invitations")."""
    _require_captain(team, by)
    racer = Racer.objects.filter(alias__iexact=alias.strip(), is_active=True, is_house=False).first()
    if racer is None:
        raise UserFault("team_no_such_racer")
    if TeamMember.objects.filter(team=team, racer=racer).exists():
        raise UserFault("team_in_it_already")
    if team.invitations.count() >= INVITATIONS:
        raise UserFault("team_too_many_invitations", limit=INVITATIONS)
    invitation, made = TeamInvitation.objects.get_or_create(team=team, racer=racer, defaults={"made_at": now})
    if made:
        record(TEAM_INVITED, at=now, racer=racer.pk, subject=team.slug)
    return invitation


@transaction.atomic
def accept_team(*, invitation: TeamInvitation, racer: Racer, now: datetime) -> Team:
    """Join by an invitation of one's own. Raises UserFault("team_not_asked" | "team_in_one_already" | "team_full")."""
    if invitation.racer_id != racer.pk or not TeamInvitation.objects.filter(pk=invitation.pk).exists():
        raise UserFault("team_not_asked")
    return _join(invitation.team, racer, now)


@audited("team.invitation_withdrawn", _("Invitation to a team withdrawn"), target="invitation", unless="racer")
def decline_team(*, invitation: TeamInvitation, by: Racer) -> None:
    """Turn an invitation down, or take it back as captain. Raises UserFault("team_captain_only")."""
    if by.pk != invitation.racer_id:
        _require_captain(invitation.team, by)
    TeamInvitation.objects.filter(pk=invitation.pk).delete()


@transaction.atomic
def join_by_link(*, code: str, racer: Racer, now: datetime) -> Team:
    """Raises UserFault("team_link_unknown" | "team_in_one_already" | "team_full")."""
    team = Team.objects.filter(code=code).first() if code else None
    if team is None:
        raise UserFault("team_link_unknown")
    return _join(team, racer, now)


@transaction.atomic
def leave_team(*, racer: Racer) -> None:
    """Leave the team; the last member closes it. Raises UserFault("team_hand_over_first") for a captain."""
    team = team_of(racer)
    if team is not None:
        _take_out(team, racer)
    elif racer.team:  # a name that was written beside the alias while there were no teams
        _name(racer, "")


@audited("team.member_removed", _("Member of a team removed"), target="team", unless="captain")
@transaction.atomic
def remove_from_team(*, team: Team, racer: Racer, by: Racer) -> None:
    """Raises UserFault("team_captain_only" | "team_not_a_member" | "team_hand_over_first")."""
    _require_captain(team, by)
    _take_out(team, _member(team, racer))


@audited("team.handed_over", _("Team handed over"), target="team", unless="captain")
@transaction.atomic
def hand_over_team(*, team: Team, to: Racer, by: Racer) -> Team:
    """Another captain. Raises UserFault("team_captain_only" | "team_not_a_member")."""
    _require_captain(team, by)
    hold(team)
    team.captain = _member(team, to)
    team.save(update_fields=["captain"])
    return team


@audited("team.link_replaced", _("Team's link replaced"), target="team", unless="captain")
def new_team_link(*, team: Team, by: Racer) -> Team:
    """Another link to join with. Raises UserFault("team_captain_only")."""
    _require_captain(team, by)
    team.code = new_code()
    team.save(update_fields=["code"])
    return team


def set_team_name(*, racer: Racer, name: str, now: datetime) -> None:
    """Join by name, for programs: "" leaves, a new name founds a team. Raises UserFault("team_by_invitation"),
    ValidationError, and as founding and leaving do."""
    Racer(team=name).clean_fields(exclude={field.name for field in Racer._meta.fields} - {"team"})
    if team_key(name) == team_key(racer.team):
        return
    with transaction.atomic():
        leave_team(racer=racer)
        if not name:
            return
        if Team.objects.filter(key=team_key(name)).exists():
            raise UserFault("team_by_invitation")
        found_team(by=racer, name=name, now=now)


def _join(team: Team, racer: Racer, now: datetime) -> Team:
    hold(team)
    hold(racer)
    if TeamMember.objects.filter(team=team, racer=racer).exists():
        return team
    _require_free(racer)
    if team.members.count() >= MEMBERS:
        raise UserFault("team_full", limit=MEMBERS)
    TeamMember.objects.create(team=team, racer=racer, joined_at=now)
    TeamInvitation.objects.filter(team=team, racer=racer).delete()
    lead_on(team)
    _name(racer, team.name)
    return team


def lead_on(team: Team) -> None:
    """Make the longest-standing member captain of a team without one; close a team without members."""
    if not Team.objects.filter(pk=team.pk, captain=None).exists():
        return
    first = team.members.select_related("racer").order_by("-racer__is_active", "joined_at", "pk").first()
    if first is None:
        team.delete()
        return
    team.captain = first.racer
    team.save(update_fields=["captain"])


def _take_out(team: Team, racer: Racer) -> None:
    hold(team)
    if racer.pk == team.captain_id and team.members.exclude(racer=racer).exists():
        raise UserFault("team_hand_over_first")
    TeamMember.objects.filter(team=team, racer=racer).delete()
    _name(racer, "")
    if not team.members.exists():
        team.delete()


def _name(racer: Racer, name: str) -> None:
    racer.team = name
    Racer.objects.filter(pk=racer.pk).update(team=name)


def _member(team: Team, racer: Racer) -> Racer:
    member = TeamMember.objects.filter(team=team, racer=racer).select_related("racer").first()
    if member is None:
        raise UserFault("team_not_a_member")
    return member.racer


def _require_captain(team: Team, by: Racer) -> None:
    if not is_captain(by, team):
        raise UserFault("team_captain_only")


def _require_free(racer: Racer) -> None:
    if TeamMember.objects.filter(racer=racer).exists():
        raise UserFault("team_in_one_already")


def _free_slug(name: str) -> str:
    slug = slugify(name)[:40].strip("-")
    if not slug or slug in RESERVED or Team.objects.filter(slug=slug).exists():
        slug = f"{slug or 'team'}-{get_random_string(6, 'abcdefghijkmnpqrstuvwxyz23456789')}"
    return slug


def lead_on_without(sender: object, *, instance: TeamMember, **kwargs: object) -> None:
    """Give a team another captain after the deletion of its captain's account."""
    team = Team.objects.filter(pk=instance.team_id, captain=None).first()
    if team is not None:
        lead_on(team)
