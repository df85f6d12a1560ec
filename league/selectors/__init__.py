"""What pages and checks ask of the league."""

from .divisions import division_of, season_of
from .fields import field_of
from .outcomes import BoardOutcome, OutcomeCut, classified_count, cut_of, outcome_of, rules_of
from .ratings import racer_ratings, season_ratings
from .seasons import (
    Champion,
    HallOfFame,
    Month,
    RacerRound,
    decisions_of,
    hall_of_fame,
    months_of,
    racer_season,
)
from .standings import country_standings, season_standings, team_standings

__all__ = [
    "BoardOutcome",
    "Champion",
    "HallOfFame",
    "Month",
    "OutcomeCut",
    "RacerRound",
    "classified_count",
    "country_standings",
    "cut_of",
    "decisions_of",
    "division_of",
    "field_of",
    "hall_of_fame",
    "months_of",
    "outcome_of",
    "racer_ratings",
    "racer_season",
    "rules_of",
    "season_of",
    "season_ratings",
    "season_standings",
    "team_standings",
]
