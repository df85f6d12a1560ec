"""Who sees which group and who is in it. Every predicate has a queryset twin; tests hold them together."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeGuard

from django.db.models import Exists, OuterRef, Q, QuerySet

from ..models import ClassTeacher, GroupMember, Racer, RacerGroup

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    Viewer = Racer | AnonymousUser | None


def can_lead(viewer: Viewer, group: RacerGroup) -> bool:
    """Whether the viewer confirms and removes members and changes the group: its leader and admins."""
    return _known(viewer) and (viewer.is_staff or viewer.pk == group.leader_id)


def can_see_group(viewer: Viewer, group: RacerGroup) -> bool:
    """Whether the viewer may know that the group exists: listed ones everybody; else who leads it, who is in it or has
    asked to be, and admins. Twin of :func:`groups_visible_to`."""
    if group.is_listed or can_lead(viewer, group):
        return True
    return _known(viewer) and GroupMember.objects.filter(group=group, racer=viewer.pk).exists()


def groups_visible_to(viewer: Viewer) -> QuerySet[RacerGroup]:
    """All groups that the viewer may know of. Twin of :func:`can_see_group`."""
    groups = RacerGroup.objects.select_related("leader")
    if not _known(viewer):
        return groups.filter(is_listed=True)
    if viewer.is_staff:
        return groups
    inside = Exists(GroupMember.objects.filter(group=OuterRef("pk"), racer=viewer.pk))
    return groups.filter(Q(is_listed=True) | Q(leader=viewer.pk) | Q(inside))


def can_see_member(viewer: Viewer, member: GroupMember) -> bool:
    """Whether the viewer may know that a racer is in a group or has asked to be: the racer, who leads it, and admins;
    once it is confirmed also who is in it, and of a listed group everybody. Twin of :func:`members_visible_to`."""
    if can_lead(viewer, member.group) or (_known(viewer) and viewer.pk == member.racer_id):
        return True
    if member.confirmed_at is None:
        return False
    return member.group.is_listed or is_in(viewer, member.group)


def members_visible_to(viewer: Viewer) -> QuerySet[GroupMember]:
    """All memberships that the viewer may know of. Twin of :func:`can_see_member`."""
    members = GroupMember.objects.select_related("racer", "group")
    if not _known(viewer):
        return members.filter(group__is_listed=True, confirmed_at__isnull=False)
    if viewer.is_staff:
        return members
    mine = GroupMember.objects.filter(group=OuterRef("group"), racer=viewer.pk, confirmed_at__isnull=False)
    seen = Q(confirmed_at__isnull=False) & (Q(group__is_listed=True) | Exists(mine))
    return members.filter(Q(racer=viewer.pk) | Q(group__leader=viewer.pk) | seen)


def is_in(racer: Viewer, group: RacerGroup | int) -> bool:
    """Whether the racer is a confirmed member."""
    return (
        _known(racer) and GroupMember.objects.filter(group=group, racer=racer.pk, confirmed_at__isnull=False).exists()
    )


def inside(group: RacerGroup) -> QuerySet[GroupMember]:
    """The confirmed members of a group."""
    return GroupMember.objects.filter(group=group, confirmed_at__isnull=False)


def may_hold_for(racer: Racer | None, group: RacerGroup) -> bool:
    """Whether the racer may hold a race for this group alone: for listed ones anybody, for others who leads them, for a
    class its second teachers too. Twin of :func:`groups_to_hold_for`."""
    if group.is_listed or can_lead(racer, group):
        return True
    return _known(racer) and ClassTeacher.objects.filter(classroom__group=group, racer=racer.pk).exists()


def groups_to_hold_for(racer: Racer) -> QuerySet[RacerGroup]:
    """The groups for which the racer may hold races. Twin of :func:`may_hold_for`."""
    groups = RacerGroup.objects.all()
    second = Exists(ClassTeacher.objects.filter(classroom__group=OuterRef("pk"), racer=racer.pk))
    return groups if racer.is_staff else groups.filter(Q(is_listed=True) | Q(leader=racer.pk) | second)


def _known(racer: Viewer) -> TypeGuard[Racer]:
    return racer is not None and racer.is_authenticated
