"""Receivers of log-ins, password changes and password resets."""

from django.conf import settings
from django.http import HttpRequest
from django.utils import timezone

from ..models import Racer
from .attempt_limits import remember_address
from .services import take_over

PASSING, PASSING_S = "passing", 600


def take_over_on_reset(sender: object, *, user: Racer, **kwargs: object) -> None:
    """A link that was sent to the account's own address was followed."""
    take_over(racer=user)


def know_the_address(sender: object, *, request: HttpRequest | None, user: Racer, **kwargs: object) -> None:
    """Somebody has logged in, or chosen a new password: they are known at this address."""
    if request is not None:
        remember_address(racer=user, request=request, now=timezone.now())


def begin_passing_session(request: HttpRequest) -> None:
    """A guest's session that ends after ten minutes, unless they log in with it."""
    request.session[PASSING] = True
    request.session.set_expiry(PASSING_S)


def keep_the_session(sender: object, *, request: HttpRequest | None, user: Racer, **kwargs: object) -> None:
    """Give a guest's short session the usual lifetime after a log-in."""
    if request is None or settings.SESSION_COOKIE_NAME not in request.COOKIES:
        return
    if request.session.pop(PASSING, False):
        request.session.set_expiry(None)
