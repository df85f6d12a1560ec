"""The rules that decide the rank of a run, and their consistency checks."""

from .race import RANKING, RANKING_METHODS, RULES

METHOD, LAPS, NEEDED = RANKING
RANKED = (METHOD, NEEDED)  # those that do not change how the run is driven


def counts_all_laps(ranking_method: str) -> bool:
    return ranking_method in RANKING_METHODS and RANKING_METHODS[ranking_method].needs_all_laps


def usually_needed(ranking_method: str, laps: int) -> int:
    """The default number of laps in a row that classify a car with ``laps`` laps."""
    return laps if counts_all_laps(ranking_method) else min(RULES[NEEDED].default, laps)


def contradiction(ranking_method: str, laps: int, needed: int) -> str:
    """The reason code of a wrong number of laps in a row, or ``""``."""
    if not 1 <= needed <= laps:
        return "race_minimum_laps"
    return "race_total_needs_all_laps" if needed != laps and counts_all_laps(ranking_method) else ""
