"""What pages and programs show of notices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db.models import QuerySet

from accounts.models import Racer

from ..models import Notice

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def notices_of(racer: Racer | AnonymousUser) -> QuerySet[Notice]:
    """What the racer was told in the site, the latest first; nothing for somebody who is not logged in."""
    if racer.pk is None:
        return Notice.objects.none()
    return Notice.objects.filter(racer_id=racer.pk, hidden=False)
