"""A season's ratings: openskill's Plackett-Luce model over the duels that were driven.

Weng and Lin, "A Bayesian Approximation Method for Online Ranking" (JMLR 12, 2011), in the package openskill with its
own defaults: everybody begins at mu 25 with sigma 25/3, and what a board shows is mu - 3 sigma, which is 0 for a
newcomer, and of two equally skilled racers higher for the one better known. Ratings depend on the order of the duels,
so callers pass them in a fixed one.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from openskill.models import PlackettLuce, PlackettLuceRating

Name = TypeVar("Name", bound=Hashable)
DIGITS = 6  # of what is kept: far finer than shown, coarser than what compilers disagree about
MODEL = PlackettLuce()


@dataclass(frozen=True)
class Rating:
    """What is believed of one racer: skill ``mu``, its uncertainty ``sigma``, and how many duels say so."""

    mu: float
    sigma: float
    duels: int

    @property
    def shown(self) -> float:
        """The skill that the racer has with near certainty."""
        return self.mu - 3 * self.sigma


def rate(duels: Iterable[Mapping[Name, int]]) -> dict[Name, Rating]:
    """Ratings after ``duels``, each a place (1 is the winner, equal places are a tie) for everybody in it.

    Duels of fewer than two say nothing and are left out.
    """
    known: dict[Name, PlackettLuceRating] = {}
    count: dict[Name, int] = {}
    for places in duels:
        if len(places) < 2:
            continue
        teams = [[known.setdefault(name, MODEL.rating())] for name in places]
        rated = MODEL.rate(teams, ranks=[float(place) for place in places.values()])
        for name, (rating,) in zip(places, rated, strict=True):
            known[name] = rating
            count[name] = count.get(name, 0) + 1
    return {name: Rating(round(one.mu, DIGITS), round(one.sigma, DIGITS), count[name]) for name, one in known.items()}
