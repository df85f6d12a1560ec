"""Visibility of groups and their members."""

from collections.abc import Collection, Sequence
from typing import Any, TypeGuard

from django.db.models import Exists, OuterRef, Q, QuerySet

from core.streams.shared_pieces import shared_value

from ..models import ClassLearner, Classroom, ClassTeacher, GroupMember, Racer, RacerGroup, Viewer


def can_lead(viewer: Viewer, group: RacerGroup) -> bool:
    """Whether the viewer confirms and removes members and changes the group: its leader and admins."""
    return _known(viewer) and (viewer.is_staff or viewer.pk == group.leader_id)


def groups_visible_to(viewer: Viewer) -> QuerySet[RacerGroup]:
    """Groups that the viewer can see: listed ones, those that they lead, are in or asked to join; admins all."""
    groups = RacerGroup.objects.select_related("leader")
    if not _known(viewer):
        return groups.filter(is_listed=True)
    if viewer.is_staff:
        return groups
    inside = Exists(GroupMember.objects.filter(group=OuterRef("pk"), racer=viewer.pk))
    return groups.filter(Q(is_listed=True) | Q(leader=viewer.pk) | Q(inside))


def visible_of(groups: Sequence[RacerGroup], viewer: Viewer) -> list[RacerGroup]:
    """Those of ``groups`` that the viewer can see: one query, or none where all are listed."""
    hidden = [group.pk for group in groups if not group.is_listed]
    seen = set(groups_visible_to(viewer).filter(pk__in=hidden).values_list("pk", flat=True)) if hidden else set()
    return [group for group in groups if group.is_listed or group.pk in seen]


def members_visible_to(viewer: Viewer) -> QuerySet[GroupMember]:
    """Memberships and requests that the viewer can see: their own, those of groups that they lead, admins all;
    confirmed ones also in listed groups and to other members."""
    members = GroupMember.objects.select_related("racer", "group")
    if not _known(viewer):
        return members.filter(group__is_listed=True, confirmed_at__isnull=False)
    if viewer.is_staff:
        return members
    mine = GroupMember.objects.filter(group=OuterRef("group"), racer=viewer.pk, confirmed_at__isnull=False)
    seen = Q(confirmed_at__isnull=False) & (Q(group__is_listed=True) | Exists(mine))
    return members.filter(Q(racer=viewer.pk) | Q(group__leader=viewer.pk) | seen)


def with_class(members: QuerySet[GroupMember]) -> QuerySet[Any]:
    """With ``is_in_class``: whether the member is a learner or a teacher of the class whose group it is."""
    same = {"classroom__group": OuterRef("group"), "racer": OuterRef("racer")}
    return members.annotate(
        is_in_class=Exists(ClassLearner.objects.filter(**same))
        | Exists(ClassTeacher.objects.filter(**same))
        | Exists(Classroom.objects.filter(group=OuterRef("group"), group__leader=OuterRef("racer")))
    )


def is_in(racer: Viewer, group: RacerGroup | int) -> bool:
    if not _known(racer):
        return False
    known = getattr(racer, "_groups_in", {}).get(group if isinstance(group, int) else group.pk)
    if known is not None:
        return bool(known)
    return inside(group).filter(racer=racer.pk).exists()


def remember_groups(racer: Racer, groups: Collection[int]) -> None:
    """Let :func:`is_in` answer from memory about these groups, on a page with many: no query for a single racer."""
    confirmed = GroupMember.objects.filter(group__in=groups, confirmed_at__isnull=False)
    members = shared_value(
        ("members of groups", *groups), lambda: frozenset(confirmed.values_list("group", "racer").order_by())
    )
    racer._groups_in = {group: (group, racer.pk) in members for group in groups}  # type: ignore[attr-defined]


def inside(group: RacerGroup | int) -> QuerySet[GroupMember]:
    return GroupMember.objects.filter(group=group, confirmed_at__isnull=False)


def may_hold_for(racer: Racer | None, group: RacerGroup) -> bool:
    """Whether the racer can create a race for this group only: anybody if it is listed, else its leader and a class's
    teachers. Twin of :func:`groups_to_hold_for`."""
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
