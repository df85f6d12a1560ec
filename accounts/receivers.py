"""What accounts do when somebody has logged in or shown who they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.http import HttpRequest
from django.utils import timezone

from .log_in import remember_address
from .services import take_over

if TYPE_CHECKING:
    from league.models import Racer


def take_over_on_reset(sender: object, *, user: Racer, **kwargs: object) -> None:
    """A link that was sent to the account's own address was followed."""
    take_over(racer=user)


def know_the_address(sender: object, *, request: HttpRequest | None, user: Racer, **kwargs: object) -> None:
    """Somebody has logged in, or chosen a new password: they are known at this address."""
    if request is not None:
        remember_address(racer=user, request=request, now=timezone.now())
