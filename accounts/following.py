"""Following racers. Only the follower and admins see whom a racer follows; the followed racer sees the number."""

from datetime import datetime

from django.db import transaction
from django.db.models import Count, QuerySet
from django.utils.translation import gettext_lazy as _

from core.database.locks import hold
from core.streams.shared_pieces import shared_value
from paddock.errors import UserFault

from .class_accounts.services import can_teach
from .models import Classroom, Follow, Racer, Viewer
from .quotas import CountedRows, Quota, Racers, limit_of, only

COUNTED = 20  # others see the number of followers up to here, then "20+"


def can_follow(viewer: Viewer, racer: Racer) -> bool:
    """Whether the viewer can follow a racer: another active account; in a class only its learners and teachers."""
    if not isinstance(viewer, Racer) or viewer.pk == racer.pk or racer.is_house:
        return False
    if not (viewer.is_active and racer.is_active):
        return False
    mine, theirs = _class_of(viewer), _class_of(racer)
    if mine is not None and theirs is not None:
        return mine == theirs
    if mine is not None:
        return can_teach(racer, mine)
    return theirs is None or can_teach(viewer, theirs)


def follows_visible_to(viewer: Viewer) -> QuerySet[Follow]:
    """Follows that the viewer sees: their own, and admins all."""
    follows = Follow.objects.select_related("followed")
    if not isinstance(viewer, Racer):
        return follows.none()
    return follows if viewer.is_staff else follows.filter(follower=viewer)


def followed_by(racer: Viewer) -> QuerySet[Follow]:
    """The racers that a racer follows, the latest first, without closed accounts."""
    mine = follows_visible_to(racer).filter(followed__is_active=True)
    return mine.filter(follower=racer.pk) if isinstance(racer, Racer) else mine


def followers_of(racer: int) -> list[int]:
    """Ids of a racer's followers with active accounts."""
    active = Follow.objects.filter(followed=racer, follower__is_active=True, followed__is_active=True)
    return list(active.order_by("pk").values_list("follower", flat=True))


def followers_shown(viewer: Viewer, racer: Racer) -> str:
    """The number of followers: exact for the racer and admins, up to ``COUNTED`` for others, empty for none."""
    active = Follow.objects.filter(followed=racer, follower__is_active=True)
    count = shared_value(("followers", racer.pk), lambda: active.count())
    is_exact = isinstance(viewer, Racer) and (viewer.is_staff or viewer.pk == racer.pk)
    return f"{COUNTED}+" if count > COUNTED and not is_exact else str(count or "")


def _followed(racers: Racers, now: datetime) -> CountedRows:
    found = only(Follow.objects.order_by(), "follower", racers)
    return found.values_list("follower").annotate(Count("pk"))


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


def _class_of(racer: Racer) -> Classroom | None:
    """No query if the class was read with the racer."""
    learner = getattr(racer, "learner", None)
    return None if learner is None else learner.classroom
