"""What accounts do when somebody has logged in or shown who they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.conf import settings
from django.http import HttpRequest
from django.utils import timezone

from .log_in import remember_address
from .models import Team, TeamMember
from .services import take_over
from .teams.services import lead_on

if TYPE_CHECKING:
    from accounts.models import Racer

PASSING, PASSING_S = "passing", 600


def take_over_on_reset(sender: object, *, user: Racer, **kwargs: object) -> None:
    """A link that was sent to the account's own address was followed."""
    take_over(racer=user)


def know_the_address(sender: object, *, request: HttpRequest | None, user: Racer, **kwargs: object) -> None:
    """Somebody has logged in, or chosen a new password: they are known at this address."""
    if request is not None:
        remember_address(racer=user, request=request, now=timezone.now())


def lead_on_without(sender: object, *, instance: TeamMember, **kwargs: object) -> None:
    """Somebody is in a team no more; if that is because their account was deleted, its team needs a captain."""
    team = Team.objects.filter(pk=instance.team_id, captain=None).first()
    if team is not None:
        lead_on(team)


def begin_passing_session(request: HttpRequest) -> None:
    """A guest's session that ends after ten minutes, unless they log in with it."""
    request.session[PASSING] = True
    request.session.set_expiry(PASSING_S)


def keep_the_session(sender: object, *, request: HttpRequest | None, user: Racer, **kwargs: object) -> None:
    """Who has logged in with a guest's session keeps it as long as any."""
    if request is None or settings.SESSION_COOKIE_NAME not in request.COOKIES:
        return
    if request.session.pop(PASSING, False):
        request.session.set_expiry(None)
