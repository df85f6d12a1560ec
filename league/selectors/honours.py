"""Wins and podiums of a racer: official results with two or more classified racers, real cars apart."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.db.models import Exists, OuterRef, Q

from evaluation.models import Evaluation
from races.models import BoardCount, Entry, Opponents, RaceKind
from races.models.counting import CLASSIFIED as RANKED
from races.models.counting import TOTAL
from races.selectors import races_visible_to
from races.selectors.boards import CLASSIFIED
from races.selectors.counting import places_of
from races.services.submissions import ACTIVE

from ..models import Round

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

LEAST = 2  # classified, for a place to be won against somebody
PODIUM = 3
AT_A_TIME = 500


@dataclass(frozen=True)
class Honours:
    """``races``: all entered; ``wins`` and ``podiums``: official results of simulated cars; ``real_wins`` and
    ``real_podiums``: those of real cars, whose times the organiser enters."""

    races: int
    wins: int
    podiums: int
    real_wins: int = 0
    real_podiums: int = 0


def honours_of(racer: Racer, viewer: Racer | AnonymousUser | None, now: datetime) -> Honours:
    """What a racer has won in races that ``viewer`` may see. Two queries, and one for every 500 races with a result.

    A result is official when its round is closed; a community race's when it has closed, its last car was timed and its
    duels are over. A field of one is nobody's win.
    """
    entries = Entry.objects.filter(
        racer=racer, withdrawn_at=None, race__in=races_visible_to(viewer).order_by().values("pk")
    )
    count = entries.count()
    several = BoardCount.objects.filter(race=OuterRef("race"), shift=TOTAL, bucket=RANKED, racers__gte=LEAST)
    won = entries.filter(_official(now), Exists(several), CLASSIFIED, is_baseline=False)
    physical = dict(won.order_by().values_list("pk", "race__physical"))
    ids = list(physical)
    places: dict[bool, list[int]] = {False: [], True: []}
    for begin in range(0, len(ids), AT_A_TIME):
        for entry, place in places_of(ids[begin : begin + AT_A_TIME]).items():
            places[physical[entry]].append(place)
    counts = ((found.count(0), sum(place < PODIUM for place in found)) for found in places.values())
    return Honours(count, *itertools.chain(*counts))


def _official(now: datetime) -> Q:
    """Of an entry: whether its race's results are official."""
    rounds = Round.objects.filter(race=OuterRef("race"))
    waiting = Evaluation.objects.filter(
        submission__entry__race=OuterRef("race"), submission__entry__withdrawn_at=None, state__in=ACTIVE
    )
    community = Q(race__kind=RaceKind.COMMUNITY, race__closes_at__lte=now) & Q(~Exists(waiting))
    community &= Q(race__next_engine="")  # what is driven again may yet change it
    community &= ~Q(race__opponents=Opponents.MODELS) | Q(race__draw__over_at__isnull=False)
    return Q(race__cancelled_at=None) & (Exists(rounds.filter(closed_at__isnull=False)) | community & ~Exists(rounds))
