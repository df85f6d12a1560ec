"""Every list of races, entries and results that a page or the API shows, and who may see what."""

from .baselines import to_beat
from .boards import (
    PER_PAGE,
    Board,
    BoardRow,
    board,
    podiums,
    rank_of,
    score_column,
    whole_board,
)
from .duels import DuelRound, Duels, Heat, duels_of, heats_of
from .lists import (
    HistoryRow,
    SubmissionRow,
    cancelled_races,
    closed_races,
    entry_of,
    organised_by,
    racer_history,
    races_of,
    races_on,
    racing_now,
    replaced_by,
    submissions_of,
    upcoming,
)
from .shared_boards import shared_board
from .visibility import (
    can_organise,
    can_see_evaluation,
    can_see_race,
    evaluations_visible_to,
    races_visible_to,
)

__all__ = [
    "PER_PAGE",
    "Board",
    "BoardRow",
    "DuelRound",
    "Duels",
    "Heat",
    "HistoryRow",
    "SubmissionRow",
    "board",
    "can_organise",
    "can_see_evaluation",
    "can_see_race",
    "cancelled_races",
    "closed_races",
    "duels_of",
    "entry_of",
    "evaluations_visible_to",
    "heats_of",
    "organised_by",
    "podiums",
    "racer_history",
    "races_of",
    "races_on",
    "races_visible_to",
    "racing_now",
    "rank_of",
    "replaced_by",
    "score_column",
    "shared_board",
    "submissions_of",
    "to_beat",
    "upcoming",
    "whole_board",
]
