"""What the operations of races of real cars look up."""

from __future__ import annotations

from uuid import UUID

from django.http import Http404
from rest_framework.request import Request

from accounts.who import racer_of
from paddock.errors import UserFault

from ...models import Race
from ...selectors.timing import can_keep_time
from ..lookup import visible_race

DAY_MS = 86_400_000


def uuid_or_404(text: str) -> UUID:
    """Raises Http404 for what is none."""
    try:
        return UUID(text)
    except ValueError:
        raise Http404 from None


def timed_race(request: Request, slug: str) -> Race:
    """The race at ``slug``, in which the reader may take times. Raises Http404, UserFault("race_not_physical" |
    "timing_not_yours")."""
    race = visible_race(request, slug)
    if not race.physical:
        raise UserFault("race_not_physical")
    if not can_keep_time(racer_of(request), race):
        raise UserFault("timing_not_yours")
    return race
