"""Racers as everybody may look them up."""

from __future__ import annotations

from django.db.models import Q

from accounts.models import Racer

# The same as Racer.has_page.
SHOWN = Q(is_active=True) | Q(record_id__isnull=False, guest_name="")


def racer_shown(alias: str) -> Racer | None:
    """The racer with this alias in any case, if they have a page."""
    return Racer.objects.filter(SHOWN, alias__iexact=alias).first()
