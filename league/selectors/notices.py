"""What pages and programs show of notices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import QuerySet

from accounts.models import Racer

from ..models import Notice
from ..spoilers import spoiling

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def notices_of(racer: Racer | AnonymousUser) -> QuerySet[Notice]:
    """What the racer was told in the site, the latest first; nothing for somebody who is not logged in. What tells of
    results that they hide is left out until they have watched the race."""
    if racer.pk is None:
        return Notice.objects.none()
    told = Notice.objects.filter(racer_id=racer.pk, hidden=False)
    return told.exclude(spoiling(racer)) if racer.hides_results_since is not None else told
