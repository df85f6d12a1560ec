"""The league's rules: small classes that decide and say in a sentence what they decide. No database here.

A rule is made from the numbers of a season, for instance ``Promotion(season.promotion_percent)``. Racers are whatever
the caller identifies them by.
"""

from .field import ChampionshipField, FinaleField
from .promotion import Promotion
from .standings import PointsTable, RacerStanding, RoundRank, Standings

__all__ = [
    "ChampionshipField",
    "FinaleField",
    "PointsTable",
    "Promotion",
    "RacerStanding",
    "RoundRank",
    "Standings",
]
