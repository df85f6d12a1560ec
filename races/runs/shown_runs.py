"""The latest runs of a racer or of a model, with what the table of runs shows of them."""

from django.db.models import QuerySet

from evaluation.models import Evaluation
from paddock.rules.race import RANKING

from ..entries.engines import hidden_runs

# All columns of seven tables would take most of the time of a page
_RUN = ("public_id", "state", "reason_code", "reason_params", "queued_at", "owner_id", "track__name")
_RESULT = [f"result__{name}" for name in ("laps", "best_lap_ms", "order", "complete_laps", "off_tracks")]
_TO_RACES = ("submission__entry__race", "duel__race")
_RELATED = ("track", "result", *_TO_RACES)
_RACES = [f"{path}__{name}" for path in _TO_RACES for name in ("slug", "name", "opponents", *RANKING)]


def latest_shown(runs: QuerySet[Evaluation], most: int) -> QuerySet[Evaluation]:
    """The latest of ``runs`` that nothing hides and that were not driven again."""
    runs = runs.filter(~hidden_runs(), replaced_by=None).select_related(None).select_related(*_RELATED)
    return runs.only(*_RUN, *_RESULT, *_RACES).order_by("-queued_at")[:most]
