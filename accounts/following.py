"""Following racers: who may follow whom, who sees that they do, and doing it.

Only who follows knows whom they follow, and admins; the followed racer learns how many they are. Accounts of classes
follow and are followed within their class alone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime
from typing import TYPE_CHECKING

from django.db import transaction
from django.db.models import Count, Q, QuerySet
from django.utils.translation import gettext_lazy as _

from core.locks import hold
from paddock.errors import UserFault

from .classes import can_teach, classes_taught_by
from .models import ClassLearner, ClassTeacher, Follow, Racer
from .quotas import Quota, limit_of

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    Viewer = Racer | AnonymousUser | None

COUNTED = 20  # followers that others are told the number of; beyond it stands "20+"


def can_follow(viewer: Viewer, racer: Racer) -> bool:
    """Whether the viewer may follow a racer: somebody else whose account is active and no house car's. Who is in a
    class follows, and is followed by, only its learners and teachers. Twin of :func:`racers_to_follow`."""
    if not isinstance(viewer, Racer) or viewer.pk == racer.pk or racer.is_house:
        return False
    if not (viewer.is_active and racer.is_active):
        return False
    mine, theirs = _class_of(viewer), _class_of(racer)
    if mine is None and theirs is None:
        return True
    if mine is not None and theirs is not None:
        return mine.classroom_id == theirs.classroom_id
    if mine is not None:
        return can_teach(racer, mine.classroom)
    return theirs is not None and can_teach(viewer, theirs.classroom)


def racers_to_follow(viewer: Viewer) -> QuerySet[Racer]:
    """All racers whom the viewer may follow. Twin of :func:`can_follow`."""
    if not isinstance(viewer, Racer) or not viewer.is_active:
        return Racer.objects.none()
    others = Racer.objects.filter(is_active=True, is_house=False).exclude(pk=viewer.pk)
    mine = _class_of(viewer)
    if mine is None:
        return others.filter(Q(learner=None) | Q(learner__classroom__in=classes_taught_by(viewer)))
    second = ClassTeacher.objects.filter(classroom=mine.classroom_id).values("racer")
    teachers = Q(pk=mine.classroom.group.leader_id) | Q(pk__in=second)
    return others.filter(Q(learner__classroom=mine.classroom_id) | teachers & Q(learner=None))


def can_see_follow(viewer: Viewer, follow: Follow) -> bool:
    """Whether the viewer may know that one racer follows another: who follows, and admins. Twin of
    :func:`follows_visible_to`."""
    return isinstance(viewer, Racer) and (viewer.is_staff or viewer.pk == follow.follower_id)


def follows_visible_to(viewer: Viewer) -> QuerySet[Follow]:
    """Twin of :func:`can_see_follow`."""
    follows = Follow.objects.select_related("followed")
    if not isinstance(viewer, Racer):
        return follows.none()
    return follows if viewer.is_staff else follows.filter(follower=viewer)


def followed_by(racer: Viewer) -> QuerySet[Follow]:
    """Whom a racer follows, the latest first, without accounts that are closed by now."""
    mine = follows_visible_to(racer).filter(followed__is_active=True)
    return mine.filter(follower=racer.pk) if isinstance(racer, Racer) else mine


def followers_of(racer: int) -> list[int]:
    """Who follows a racer (ids) and is to hear of them: nobody whose account is closed."""
    active = Follow.objects.filter(followed=racer, follower__is_active=True, followed__is_active=True)
    return list(active.order_by("pk").values_list("follower", flat=True))


def followers_shown(viewer: Viewer, racer: Racer) -> str:
    """How many follow a racer, as the viewer is told it: the racer and admins the number, others none beyond
    ``COUNTED``; empty for nobody."""
    active = Follow.objects.filter(followed=racer, follower__is_active=True)
    if isinstance(viewer, Racer) and (viewer.is_staff or viewer.pk == racer.pk):
        return str(active.count() or "")
    count = active[: COUNTED + 1].count()
    return f"{COUNTED}+" if count > COUNTED else str(count or "")


def _followed(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    found = Follow.objects.order_by()
    if racers is not None:
        found = found.filter(follower__in=racers)
    return dict(found.values_list("follower").annotate(Count("pk")))


FOLLOWED = Quota(13, "followed", "FOLLOWED_PER_RACER", _("Racers you follow"), _followed)


@transaction.atomic
def follow_racer(*, follower: Racer, racer: Racer, now: datetime) -> Follow:
    """Follow a racer; doing it again changes nothing. Raises UserFault("follow_not_this" | "follow_too_many")."""
    hold(follower)
    known = Follow.objects.filter(follower=follower, followed=racer).first()
    if known is not None:
        return known
    if not can_follow(follower, racer):
        raise UserFault("follow_not_this")
    limit = limit_of(follower, FOLLOWED.name)
    if Follow.objects.filter(follower=follower).count() >= limit:
        raise UserFault("follow_too_many", limit=limit)
    return Follow.objects.create(follower=follower, followed=racer, since=now)


def unfollow_racer(*, follower: Racer, racer: Racer) -> None:
    """Follow a racer no more; of whom one did not follow nothing changes."""
    Follow.objects.filter(follower=follower, followed=racer).delete()


def _class_of(racer: Racer) -> ClassLearner | None:
    return ClassLearner.objects.filter(racer=racer).select_related("classroom__group").first()
