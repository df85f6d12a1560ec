"""Which of the actions on a round make sense at a moment, for the pages that offer them."""

from __future__ import annotations

from datetime import datetime

from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _

from races.models import RaceState

from .models import Round

# by the name of the action in the admin site, in the order in which they are offered
TITLES: dict[str, Promise] = {
    "publish": _("Publish results"),
    "disqualify": _("Disqualify"),
    "put_back": _("Reinstate"),
    "take_back": _("Revoke results"),
    "lock": _("Lock results"),
    "postpone": _("Postpone"),
    "announce": _("Announce"),
}


def actions_now(round_: Round, now: datetime) -> list[tuple[str, Promise]]:
    """Name and title of each action that is not refused from the start; what is refused for more says why itself."""
    state = round_.race.state_at(now)
    wanted = {"announce"}
    if round_.closed_at is not None:
        wanted |= {"disqualify", "put_back", "take_back", "lock"} if round_.is_under_review(now) else set()
    elif state == RaceState.CLOSED:
        wanted |= {"publish", "disqualify", "put_back"}
    elif state == RaceState.OPEN:
        wanted |= {"disqualify", "put_back", "postpone"}
    elif state == RaceState.UPCOMING:
        wanted |= {"postpone"}
    return [(name, title) for name, title in TITLES.items() if name in wanted]
