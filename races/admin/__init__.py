"""Races in the admin site: schedule, edit, cancel and clone them; results are read-only."""

from .duels import DrawAdmin, DuelAdmin
from .race import RaceAdmin
from .rechecks import RecheckAdmin
from .results import EntryAdmin, OwnEvaluationAdmin, SubmissionAdmin
