"""Who may enter a race and submit to it: checks that rooms above this one add."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import TYPE_CHECKING

from paddock.errors import UserFault

if TYPE_CHECKING:
    from accounts.models import Racer

    from .models import Race

Check = Callable[["Race", "Racer", datetime], None]

_CHECKS: list[Check] = []


def register(check: Check) -> Check:
    """Add a check: ``check(race, racer, now)`` raises UserFault to refuse. Registering one twice changes nothing."""
    if check not in _CHECKS:
        _CHECKS.append(check)
    return check


def check_eligible(race: Race, racer: Racer, now: datetime) -> None:
    """Raise the UserFault of the first check that refuses. House cars race everywhere, outside the ranking."""
    if racer.is_house:
        return
    for check in _CHECKS:
        check(race, racer, now)


def refusal(race: Race, racer: Racer, now: datetime) -> UserFault | None:
    """What :func:`check_eligible` would raise, for a page that offers a race or says why not."""
    try:
        check_eligible(race, racer, now)
    except UserFault as fault:
        return fault
    return None
