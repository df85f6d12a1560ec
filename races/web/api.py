"""Lookups for the API; objects that the reader may not see are not found."""

from django.shortcuts import get_object_or_404
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request

from paddock.errors import UserFault

from ..entries.selectors.lists import entry_of
from ..entries.selectors.visibility import can_organise, race_invited_to
from ..models import Entry, Race
from .views import visible_evaluation as visible_evaluation
from .views import visible_race as visible_race
from .views import watched_race as watched_race


def organised_race(request: Request, slug: str) -> Race:
    """The race at ``slug``, which the reader organises. Raises Http404, PermissionDenied."""
    race = visible_race(request, slug)
    if not can_organise(request.user, race):
        raise PermissionDenied()
    return race


def organised_entry(request: Request, slug: str, alias: str) -> Entry:
    """A racer's entry in a race that the reader organises. Raises as :func:`organised_race`."""
    entries = Entry.objects.select_related("race", "racer", "best__evaluation")
    return get_object_or_404(entries, race=organised_race(request, slug), racer__alias__iexact=alias)


def invitation(request: Request, token: str) -> str:
    """The token of an invitation to a race. Raises UserFault("invitation_unknown")."""
    if race_invited_to(token) is None:
        raise UserFault("invitation_unknown")
    return token


def own_entry(request: Request, slug: str) -> Entry:
    """The reader's entry in the race at ``slug``. Raises Http404, UserFault("entry_missing")."""
    entry = entry_of(visible_race(request, slug), request.user)
    if entry is None:
        raise UserFault("entry_missing")
    return entry
