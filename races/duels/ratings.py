"""A season's ratings: openskill's Plackett-Luce model with its defaults over the duels that were driven.

Weng and Lin, "A Bayesian Approximation Method for Online Ranking" (JMLR 12, 2011). A board shows mu - 3 sigma, 0 for a
newcomer. Ratings depend on the order of the duels, so callers pass them in a fixed one.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from openskill.models import PlackettLuceRating

Name = TypeVar("Name", bound=Hashable)
DIGITS = 6  # of stored values: far finer than shown, coarser than differences between compilers


@dataclass(frozen=True)
class Rating:
    """A racer's rating: skill ``mu``, its uncertainty ``sigma``, and the number of duels behind it."""

    mu: float
    sigma: float
    duels: int

    @property
    def shown(self) -> float:
        """The skill that the racer has with near certainty."""
        return self.mu - 3 * self.sigma


def rate(duels: Iterable[Mapping[Name, int]]) -> dict[Name, Rating]:
    """Ratings after ``duels``, each a place (1 is the winner, equal places are a tie) for everybody in it. Duels of
    fewer than two say nothing and are left out."""
    from openskill.models import PlackettLuce  # loaded by the rating itself alone

    model = PlackettLuce()
    known: dict[Name, PlackettLuceRating] = {}
    count: dict[Name, int] = {}
    for places in duels:
        if len(places) < 2:
            continue
        teams = [[known.setdefault(name, model.rating())] for name in places]
        rated = model.rate(teams, ranks=[float(place) for place in places.values()])
        for name, (rating,) in zip(places, rated, strict=True):
            known[name] = rating
            count[name] = count.get(name, 0) + 1
    return {name: Rating(round(one.mu, DIGITS), round(one.sigma, DIGITS), count[name]) for name, one in known.items()}
