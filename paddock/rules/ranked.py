"""What the laps of a run are worth: the rules that decide it, and what they ask of one another."""

from __future__ import annotations

from .race import RANKING, RULES, TOTAL

METHOD, LAPS, NEEDED = RANKING
# Of these, what does not change how the run is driven.
RANKED = (METHOD, NEEDED)


def usually_needed(ranking_method: str, laps: int) -> int:
    """Laps in a row that classify a car which drives ``laps``, where nobody says otherwise: what a race usually asks,
    or as many as are driven, and all of them where the total ranks."""
    return laps if ranking_method == TOTAL else min(RULES[NEEDED].default, laps)


def contradiction(ranking_method: str, laps: int, needed: int) -> str:
    """The reason code of what is wrong with the laps in a row that classify a car, or ``""``."""
    if not 1 <= needed <= laps:
        return "race_minimum_laps"
    return "race_total_needs_all_laps" if ranking_method == TOTAL and needed != laps else ""
