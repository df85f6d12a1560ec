"""Where a run lost most: its slowest complete lap against its own best one."""

from typing import NamedTuple

from core.streams.shared_pieces import lasting_value
from evaluation.models import Evaluation
from paddock.errors import PaddockError

from .document import document_key, telemetry_document
from .selectors import asked_lap


class LargestLoss(NamedTuple):
    """A loss in words, its lap, and the moment in it when the car came to the place, in whole seconds."""

    sentence: str
    lap: int
    second: int


def largest_loss(run: Evaluation) -> LargestLoss | None:
    """The largest loss of a finished run; None without two complete laps, without losses, and while its trace cannot be
    read. Worked out once for all readers of a language."""
    complete = [lap for lap in run.result.laps if lap["complete"]]
    slowest = max(complete, key=lambda lap: lap["time_ms"], default=None)
    if len(complete) < 2 or slowest is None:
        return None
    laps = [asked_lap(run, slowest["number"])]

    def find() -> LargestLoss | None:
        try:
            losses = telemetry_document(laps)["losses"]
        except PaddockError:
            return None
        return LargestLoss(losses[0]["sentence"], laps[0].number, losses[0]["t_ms"] // 1000) if losses else None

    return lasting_value(("largest loss", document_key(laps)), find)
