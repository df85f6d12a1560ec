"""What a steward can choose from: the actions on a round, its competitors, and those removed from its board."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from django.db.models import Q
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _

from races.boards.selectors.board import ORDER, ranks_of
from races.models import Entry, RaceState

from ..models import Round

SHOWN = 50  # on one page; the others are found by alias


@dataclass(frozen=True)
class Competitors:
    """Racers to choose from. ``rows``: at most SHOWN entries with their rank (None if not classified); ``count``:
    all."""

    rows: list[tuple[Entry, int | None]]
    count: int


def competitors_of(rounds: Sequence[Round], chosen: str = "", find: str = "", *, gone: bool = False) -> Competitors:
    """The racers on the boards of ``rounds``, or with ``gone`` those removed, without house cars. ``find``: part of an
    alias or guest name; ``chosen``: an alias that is always included."""
    entries = Entry.objects.filter(race__in=[one.race_id for one in rounds], is_baseline=False)
    entries = entries.filter(removed_at__isnull=False) if gone else entries.filter(withdrawn_at=None)
    named = Q(racer__alias__icontains=find) | Q(racer__guest_name__icontains=find)
    found = entries.filter(named) if find else entries
    shown = list(found.select_related("racer", "race").order_by("race", *ORDER)[:SHOWN])
    if chosen and all(one.racer.alias.lower() != chosen.lower() for one in shown):
        shown += entries.filter(racer__alias__iexact=chosen).select_related("racer", "race")
    ranks = ranks_of(shown)
    return Competitors([(one, ranks[one.pk]) for one in shown], found.count())


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
    """Name and title of each action that is not refused from the start; the action itself refuses for other reasons."""
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
