"""Races in the admin site: schedule, change what may change, cancel, clone; results are read, never edited."""

from .duels import DrawAdmin, DuelAdmin
from .race import RaceAdmin
from .results import EntryAdmin, OwnEvaluationAdmin, SubmissionAdmin

__all__ = ["DrawAdmin", "DuelAdmin", "EntryAdmin", "OwnEvaluationAdmin", "RaceAdmin", "SubmissionAdmin"]
