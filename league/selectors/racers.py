"""Racers as everybody may look them up."""

from __future__ import annotations

from datetime import datetime

from django.db.models import Min, Q

from accounts.models import Racer
from races.models import Race

# The same as Racer.has_page.
SHOWN = Q(is_active=True) | Q(record_id__isnull=False, guest_name="")


def racer_shown(alias: str) -> Racer | None:
    """The racer with this alias in any case, if they have a page."""
    return Racer.objects.filter(SHOWN, alias__iexact=alias).first()


def racing_since(racer: Racer) -> datetime:
    """When a racer joined; of one who came with an imported season, the opening of their first race."""
    if racer.record_id is None:
        return racer.joined_at
    first = Race.objects.filter(entries__racer=racer).aggregate(first=Min("opens_at"))["first"]
    return racer.joined_at if first is None else min(first, racer.joined_at)
