"""Whose laps may bear the marks of a race's fastest."""

from __future__ import annotations

from evaluation.models import Evaluation

from .live_rules import begins_elsewhere
from .models import Race
from .ranking import standing_in


def race_of_marks(evaluation: Evaluation) -> Race | None:
    """The race whose fastest times the laps of a finished run are held against for purple.

    None for a run that takes none: one that is not classified or of another engine, a house car's, a test drive, one of
    a live event with another start. Cars in duels have all been classified.
    """
    if begins_elsewhere(evaluation):
        return None
    submission, duel = getattr(evaluation, "submission", None), getattr(evaluation, "duel", None)
    if submission is None:
        return None if duel is None else duel.race
    entry = submission.entry
    if entry.is_baseline or evaluation.result.engine != entry.race.engine:
        return None
    standing = standing_in(entry.race, evaluation.result.laps)
    return entry.race if standing.classified else None
