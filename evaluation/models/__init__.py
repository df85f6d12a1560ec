"""The tables of stored files, models, evaluations, results, workers and reports."""

from . import reports as reports
from .evaluations import FINAL_STATES, Evaluation, EvaluationRival, OpenRuns, State
from .results import CompetitorResult, OpenResults, Result, RivalResult, alone
from .stored_files import SHA256, Damage, StoredFile
from .trained_models import Network, TrainedModel
from .workers import WorkerNode
