"""Making groups, asking to be in one, confirming, leaving."""

from datetime import datetime

from django.db import transaction
from django.db.models import ProtectedError
from django.utils.crypto import get_random_string
from django.utils.text import slugify
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.database.locks import hold
from paddock.errors import UserFault

from ..models import Classroom, GroupMember, Racer, RacerGroup
from ..models.access import new_code
from .selectors import can_lead, with_class

GROUPS_PER_RACER = 20
RESERVED = frozenset({"new", "join"})


@audited("group.created", _("Group created"))
@transaction.atomic
def make_group(*, by: Racer, name: str, now: datetime, description: str = "") -> RacerGroup:
    """A group that ``by`` leads, not listed. Raises UserFault("group_limit") and django's ValidationError by field."""
    hold(by)
    if not by.is_staff and by.groups_led.count() >= GROUPS_PER_RACER:
        raise UserFault("group_limit", limit=GROUPS_PER_RACER)
    group = RacerGroup(leader=by, name=name.strip(), description=description.strip(), made_at=now)
    group.slug = free_slug(group.name)
    group.full_clean()
    group.save()
    return group


@audited("group.changed", _("Group changed"), target="group")
def change_group(*, group: RacerGroup, by: Racer, name: str, description: str) -> RacerGroup:
    """Another name or description; the address stays. Raises UserFault("group_not_yours") and ValidationError."""
    _require_lead(group, by)
    group.name, group.description = name.strip(), description.strip()
    group.clean_fields(exclude={"leader", "made_at"})
    group.save(update_fields=["name", "description"])
    return group


@transaction.atomic
def ask_to_join(*, code: str, racer: Racer, now: datetime) -> GroupMember:
    """Ask to join the group of a link; its leader is a member at once. Raises UserFault("group_link_unknown")."""
    group = RacerGroup.objects.filter(code=code).first() if code else None
    if group is None:
        raise UserFault("group_link_unknown")
    leads = racer.pk == group.leader_id
    member, _made = GroupMember.objects.get_or_create(
        group=group,
        racer=racer,
        defaults={"asked_at": now, "confirmed_at": now if leads else None, "confirmed_by": racer if leads else None},
    )
    return member


@audited("group.member_confirmed", _("Member of a group confirmed"), target="member")
def confirm_member(*, member: GroupMember, by: Racer, now: datetime) -> GroupMember:
    """Say that the racer belongs to the group. Raises UserFault("group_not_yours")."""
    _require_lead(member.group, by)
    GroupMember.objects.filter(pk=member.pk, confirmed_at=None).update(confirmed_at=now, confirmed_by=by)
    member.refresh_from_db()
    return member


@audited("group.member_removed", _("Member of a group removed"), target="member")
def remove_member(*, member: GroupMember, by: Racer) -> None:
    """Remove a member or decline a request; racers may leave, except from their class. Raises
    UserFault("group_not_yours" | "group_is_a_class")."""
    if by.pk != member.racer_id:
        _require_lead(member.group, by)
    if with_class(GroupMember.objects.filter(pk=member.pk)).filter(is_in_class=True).exists():
        raise UserFault("group_is_a_class")
    GroupMember.objects.filter(pk=member.pk).delete()


@audited("group.handed_over", _("Group handed over"), target="group")
def hand_over_group(*, group: RacerGroup, to: Racer, by: Racer) -> RacerGroup:
    """Let a confirmed member lead. Raises UserFault("group_not_yours" | "group_not_a_member" | "group_is_a_class")."""
    _require_lead(group, by)
    if Classroom.objects.filter(group=group).exists():
        raise UserFault("group_is_a_class")
    if not GroupMember.objects.filter(group=group, racer=to, confirmed_at__isnull=False).exists():
        raise UserFault("group_not_a_member")
    group.leader = to
    group.save(update_fields=["leader"])
    return group


@audited("group.link_replaced", _("Group's link replaced"), target="group")
def new_group_link(*, group: RacerGroup, by: Racer) -> RacerGroup:
    """Another link to ask with; the one before is worth nothing. Raises UserFault("group_not_yours")."""
    _require_lead(group, by)
    group.code = new_code()
    group.save(update_fields=["code"])
    return group


@audited("group.deleted", _("Group deleted"), target="group")
def delete_group(*, group: RacerGroup, by: Racer) -> None:
    """Raises UserFault("group_not_yours"), and UserFault("group_has_races") where races are held for it alone."""
    _require_lead(group, by)
    if Classroom.objects.filter(group=group).exists():
        raise UserFault("group_is_a_class")
    try:
        group.delete()
    except ProtectedError:
        raise UserFault("group_has_races") from None


def free_slug(name: str) -> str:
    slug = slugify(name)[:40].strip("-")
    if not slug or slug in RESERVED or RacerGroup.objects.filter(slug=slug).exists():
        slug = f"{slug or 'group'}-{get_random_string(6, 'abcdefghijkmnpqrstuvwxyz23456789')}"
    return slug


def _require_lead(group: RacerGroup, by: Racer) -> None:
    if not can_lead(by, group):
        raise UserFault("group_not_yours")
